# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Completion in the shell: argcomplete reads the parser, and only the shell's completion imports it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from repository import REPOSITORY

CALL = (sys.executable, "-m", "push_predictor.cli")


def completed(line: str, folder: Path) -> list[str]:
    """What the Tab key offers at the end of a line."""
    answer = folder / "answer"
    shell = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE_IFS": "\n"}
    environment = {**os.environ, **shell, "_ARGCOMPLETE_STDOUT_FILENAME": str(answer), "PYTHONPATH": _path()}
    done = subprocess.run(CALL, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout == "", done.stderr
    return [word.strip() for word in answer.read_text().splitlines()]


def _path() -> str:
    return os.pathsep.join([str(REPOSITORY), os.environ.get("PYTHONPATH", "")])


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("push_predictor tra", ["train", "trace"]),
        ("push_predictor train --kind ", ["vhgp", "gp", "analytical", "prior"]),
        ("push_predictor suggest --spe", ["--speed-range"]),
        ("push_predictor predict mod", ["model.pushmodel"]),
    ],
)
def test_commands_options_and_files_are_completed(line: str, offered: list[str], tmp_path: Path) -> None:
    pytest.importorskip("argcomplete")
    (tmp_path / "model.pushmodel").touch()
    assert sorted(completed(line, tmp_path)) == sorted(offered)


def test_the_command_is_marked_for_the_shells_global_completion() -> None:
    assert "PYTHON_ARGCOMPLETE_OK" in (REPOSITORY / "push_predictor" / "cli.py").read_text()[:1024]


def test_completion_without_argcomplete_is_no_traceback(tmp_path: Path) -> None:
    code = "import sys; sys.modules['argcomplete'] = None; from push_predictor.cli import main; main([])"
    environment = {**os.environ, "_ARGCOMPLETE": "1", "PYTHONPATH": _path()}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert done.returncode == 2 and "Traceback" not in done.stderr
