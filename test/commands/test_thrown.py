# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Whatever is thrown at a command ends in one line and a status, not in a traceback or a fault of the program."""

from __future__ import annotations

import re
from pathlib import Path
from unittest.mock import patch

import pytest

pytest.importorskip("rosbags")
from thrown import Sound, Thrower

from push_predictor.cli import TRACEBACK, main
from push_predictor.commands import info_command

GROUPS, CALLS = 4, 75  # of one number each; twenty times as many found one fault
FAULT = "This is a fault of the program"


@pytest.fixture(scope="module")
def thrower(tmp_path_factory: pytest.TempPathFactory) -> Thrower:
    folder = tmp_path_factory.mktemp("thrown")
    for name in ("sound", "files", "files/out"):
        (folder / name).mkdir()
    return Thrower(Sound.made(folder / "sound"), folder / "files")


def status_of(call: list[str]) -> object:
    try:
        return main(call)
    except SystemExit as end:  # of argparse
        return end.code


@pytest.mark.parametrize("group", range(GROUPS))
def test_a_call_of_random_files_and_options_ends_in_one_line(
    thrower: Thrower, group: int, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # some options name a file
    for number in range(group * CALLS, (group + 1) * CALLS):
        call = thrower.call(number)
        status, err = status_of(call), capsys.readouterr().err
        assert status in (0, 1, 2) and "Traceback" not in err and FAULT not in err, (number, call, err)
        own = re.findall(rf"^push_predictor {call[0]}: .+$", err, re.MULTILINE)
        assert status != 1 or len(own) == 1, (number, call, err)


def test_an_unforeseen_failure_is_one_line_that_says_how_to_see_more(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(path: Path) -> dict[str, object]:
        raise KeyError(f"of\nthe program in {path.name}")

    (tmp_path / "a.pushmodel").write_bytes(b"")
    call = ["info", str(tmp_path / "a.pushmodel")]
    monkeypatch.delenv(TRACEBACK, raising=False)
    with patch.object(info_command, "_describe_model", failing):
        assert main(call) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert re.fullmatch(
            r"push_predictor info: KeyError: .*of.nthe program in a\.pushmodel.* \(test_thrown\.py line \d+\)\. "
            rf"{FAULT}, not of the call\. PUSH_PREDICTOR_TRACEBACK=1 shows the traceback; please report it\.",
            line,
        )
        monkeypatch.setenv(TRACEBACK, "1")
        assert main(call) == 1
        *before, last = capsys.readouterr().err.splitlines()
        assert before[0].startswith("Traceback") and last == line
