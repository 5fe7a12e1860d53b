# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""docs/reference/json.md names every key that commands write with --json; those of a trace: test_documentation."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator

import pytest
from repository import BAGS, REPOSITORY

from push_predictor.cli import main

pytestmark = pytest.mark.slow
DOCS = REPOSITORY / "docs"
PAGE = (DOCS / "reference" / "json.md").read_text() + (DOCS / "explanation" / "alarm.md").read_text()  # which it links
COMMANDS = [
    f"validate default {BAGS / 'square_abs_repeats'}",
    f"check {BAGS / 'hexagon_delrin'}",
    "rig --square 0.09 --tip-radius 0.00475 --surface abs --out OUT",
    "suggest default --count 2 --out OUT",
]
BY_NAME = {"windows_by_side", "record", "values"}  # their keys are names of sides, of fields, of quantities


def keys(found: object) -> Iterator[str]:
    """All keys that are no numbers and no paths."""
    for key, value in found.items() if isinstance(found, dict) else ():
        yield from [key] if re.fullmatch(r"[a-z_]+", key) else []
        yield from () if key in BY_NAME else keys(value)
    for value in found if isinstance(found, list) else ():
        yield from keys(value)


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.split()[0])
def test_the_page_names_every_key_that_a_command_writes(
    command: str, tmp_path: object, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command.replace("OUT", f"{tmp_path}/out").split(), "--json", "-"]) == 0
    text = capsys.readouterr().out
    found = set(keys(json.loads(text[text.index("{") :])))
    assert found and not {key for key in found if not re.search(rf"[`\"\].]{key}[`\"]", PAGE)}
