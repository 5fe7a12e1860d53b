# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Options: one meaning for each name in all commands, no abbreviations, and completion in the shell."""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from repository import REPOSITORY

from push_predictor.cli import build_parser
from push_predictor.commands.common.options import with_signed_axes


def parsers(parser: argparse.ArgumentParser, words: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The words of every command that has no sub-commands."""
    nested = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    for action in nested:
        for name, child in action.choices.items():
            yield from parsers(child, (*words, name))
    if not nested:
        yield words


def parser_of(words: tuple[str, ...]) -> argparse.ArgumentParser:
    parser = build_parser()
    for word in words:
        (nested,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
        parser = nested.choices[word]
    return parser


CALLS = list(parsers(build_parser()))
TAKES_A_MODEL = ("predict", "suggest", "evaluate", "validate", "trace", "report validation")


def meaning(action: argparse.Action) -> tuple[object, ...]:
    """What a name stands for: kind of value, and the first phrase of its help."""
    phrase = re.split(r"[:;.(]", action.help or "")[0].strip()
    return (type(action), action.type, action.metavar, action.nargs, tuple(action.choices or ()), phrase)


def test_an_option_has_the_same_meaning_in_every_command() -> None:
    meanings: dict[str, dict[tuple[object, ...], str]] = defaultdict(dict)
    for words in CALLS:
        for action in parser_of(words)._actions:
            for option in action.option_strings:
                meanings[option].setdefault(meaning(action), " ".join(words))
    assert {"--json", "--out", "--seed", "--rig", "--travel"} <= meanings.keys()
    different = {option: found for option, found in meanings.items() if len(found) > 1}
    assert not different


@pytest.mark.parametrize("words", CALLS, ids=" ".join)
def test_a_model_file_is_an_argument_and_never_an_option(words: tuple[str, ...]) -> None:
    actions = {action.metavar: action for action in parser_of(words)._actions}
    assert ("MODEL" in actions) is (" ".join(words) in TAKES_A_MODEL)
    if "MODEL" in actions:
        assert not actions["MODEL"].option_strings
        if words != ("report", "validation"):  # KIND comes first there
            first = next(action for action in parser_of(words)._actions if not action.option_strings)
            assert first.metavar == "MODEL"
    assert not any("--model" in action.option_strings for action in parser_of(words)._actions)


def test_no_option_may_be_abbreviated() -> None:
    assert [words for words in ((), *CALLS) if parser_of(words).allow_abbrev] == []


@pytest.mark.parametrize("words", CALLS, ids=" ".join)
def test_the_command_line_page_has_every_option_of_a_command(words: tuple[str, ...]) -> None:
    text = (REPOSITORY / "docs" / "reference" / "command_line.md").read_text()
    sections = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL))
    known = sections[words[0]] + sections["Conventions"]
    options = {option for action in parser_of(words)._actions for option in action.option_strings}
    missing = [option for option in options - {"-h", "--help"} if not re.search(rf"`{option}\b(?!-)", known)]
    assert not missing


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["check", "a", "--up", "-z"], ["check", "a", "--up=-z"]),
        (["--up", "y", "-z"], ["--up", "y", "-z"]),
        (["--up", "slider=-x", "--up", "-x"], ["--up", "slider=-x", "--up=-x"]),
        (["--up", "-h"], ["--up", "-h"]),
        (["--up"], ["--up"]),
    ],
)
def test_an_axis_with_a_minus_is_the_value_of_up(words: list[str], found: list[str]) -> None:
    assert with_signed_axes(words) == found
    assert build_parser().parse_args(["check", "a", *with_signed_axes(["--up", "-y"])]).up == "-y"


# --- completion -------------------------------------------------------------------------------------------------------


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
