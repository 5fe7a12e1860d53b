# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The files of push_predictor_interfaces: every field is explained, every number has a unit, codes are the same."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest
from repository import REPOSITORY

from push_predictor.error_codes import ErrorCode

FILES = sorted(
    path
    for path in (REPOSITORY / "push_predictor_interfaces").glob("*/*")
    if path.suffix in (".msg", ".srv", ".action")
)
UNITS = {
    "[m]",
    "[m/s]",
    "[rad]",
    "[s]",
    "[s, ns]",
    "[m, m, rad]",
    "[m, unit quaternion]",
    "[products of m, m, rad]",
    "[dimensionless]",
    "[kg]",
    "[m, m, dimensionless]",
    "[unit of each covariate]",
}
WITHOUT_UNIT = ("string", "bool", "std_msgs/Header", "PushStep", "ModelInfo")


@dataclass(frozen=True)
class Field:
    """A field or constant of a section (0: request, goal or message); comment: its lines, joined."""

    section: int
    kind: str
    name: str
    value: str
    comment: str


@cache
def fields_of(path: Path) -> list[Field]:
    """The fields and constants of a file; raises ValueError for a line that is neither."""
    found, section = [], 0
    for line in path.read_text().splitlines():
        if line == "---":
            section += 1
        elif line.startswith(" "):  # continues a comment
            last = found.pop()
            found.append(Field(*list(vars(last).values())[:4], f"{last.comment} {line.strip(' #')}"))
        elif line and not line.startswith("#"):
            match = re.fullmatch(r"(\S+) (\w+)((?: = | )[\d.]+)? *(?:# (.+))?", line)
            if match is None:
                raise ValueError(f"{path.name}: {line}")
            found.append(Field(section, match[1], match[2], (match[3] or "").strip(" ="), match[4] or ""))
    return found


def is_constant(field: Field) -> bool:
    return field.name.isupper()


def constants_of(path: Path) -> dict[str, int]:
    return {field.name: int(field.value) for field in fields_of(path) if is_constant(field)}


def test_all_interfaces_are_found() -> None:
    assert len(FILES) == 26


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_field_has_a_comment_every_number_a_unit_and_every_array_a_shape(path: Path) -> None:
    assert path.read_text().startswith("# ")
    assert [field for field in fields_of(path) if len(field.comment) <= 5] == []
    for field in (field for field in fields_of(path) if not is_constant(field)):
        if not field.kind.startswith(WITHOUT_UNIT):
            assert re.match(r"\[[^\]]+\]", field.comment), field
            assert re.match(r"\[[^\]]+\]", field.comment)[0] in UNITS, field  # type: ignore[index]
        if field.kind.endswith("]"):
            assert re.search(r"shape \(\w+,( \w+,?)*\)", field.comment), field


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


@pytest.mark.parametrize("path", [path for path in FILES if path.suffix != ".msg"], ids=lambda path: path.name)
def test_a_response_declares_its_error_codes(path: Path) -> None:
    response = [field for field in fields_of(path) if field.section == 1]
    assert [field.kind for field in response if field.name == "error_code"] == ["uint16"]
    assert response[-1].name == "error_code"  # fields are only added at the end
    assert "message" in {field.name for field in response}
    codes = constants_of(path)
    assert codes["NONE"] == 0 and "INTERNAL_ERROR" in codes
    assert codes == {name: ErrorCode[name] for name in codes}


def test_every_error_code_is_used() -> None:
    answers = [path for path in FILES if path.suffix != ".msg"]
    assert {name for path in answers for name in constants_of(path)} == set(ErrorCode.__members__)
