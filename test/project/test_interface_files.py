# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The files of push_predictor_interfaces: one definition of the push frame, and the error codes of the library."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from repository import REPOSITORY

from push_predictor.error_codes import ErrorCode

FILES = sorted(
    path
    for path in (REPOSITORY / "push_predictor_interfaces").glob("*/*")
    if path.suffix in (".msg", ".srv", ".action")
)


ANSWERS = [path for path in FILES if path.suffix != ".msg"]


def response_of(path: Path) -> list[list[str]]:
    """Type and name of each field of a response, and of each constant."""
    lines = path.read_text().split("\n---\n")[1].splitlines()
    return [line.split("#")[0].split() for line in lines if line and not line.startswith(("#", " "))]


def constants_of(path: Path) -> dict[str, int]:
    return {name: int(value) for _, name, value in re.findall(r"^(\w+) ([A-Z_]+) ?= ?(\d+)", path.read_text(), re.M)}


def test_a_file_with_an_outcome_defines_the_push_frame_and_definitions_are_the_same() -> None:
    for text in (path.read_text() for path in FILES):
        if "dtheta" in text or "push frame" in text:
            assert "\n# Push frame: " in text and "counter-clockwise" in text, text
    for begin in ("# Push frame: ", "# Contact: "):
        blocks = {
            re.split(r"\n(?!# )|\n# (?=Contact)", path.read_text().split(begin, 1)[1])[0]
            for path in FILES
            if begin in path.read_text()
        }
        assert len(blocks) == 1, blocks


@pytest.mark.parametrize("path", ANSWERS, ids=lambda path: path.name)
def test_a_response_declares_its_error_codes(path: Path) -> None:
    fields = [words for words in response_of(path) if not words[1].isupper() and "=" not in words[1]]
    assert [words[0] for words in fields if words[1] == "error_code"] == ["uint16"]
    assert fields[-1][1] == "error_code"  # fields are only added at the end
    assert "message" in {name for _, name, *_ in fields}
    codes = constants_of(path)
    assert codes["NONE"] == 0 and "INTERNAL_ERROR" in codes
    assert codes == {name: ErrorCode[name] for name in codes}


def test_every_error_code_is_used() -> None:
    assert {name for path in ANSWERS for name in constants_of(path)} == set(ErrorCode.__members__)
