# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What pushes leave out of the domain where they judge a model, in words; silent for pushes that cover enough."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from repository import REPOSITORY
from synthetic import square_pushes

from push_predictor.geometry.shapes import shape_outline
from push_predictor.recordings.checks.coverage import MEANING, pushed_part
from push_predictor.recordings.load import load_data
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.table import PushTable, empty_table

TABLE, RIG = square_pushes(90)
HEXAGON = REPOSITORY / "bags" / "hexagon_delrin"


def of_angles(scale: float) -> PushTable:
    return replace(TABLE, inputs=TABLE.inputs * [1.0, 1.0, scale])


def test_pushes_all_around_give_no_warning() -> None:
    assert pushed_part(TABLE, RIG) == [] and pushed_part(TABLE) == []
    assert pushed_part(empty_table(), RIG) == []
    assert pushed_part(load_data([HEXAGON]), read_recording(HEXAGON).rig) == []


@pytest.mark.parametrize(("rows", "count"), [(3, "1 push"), (6, "2 pushes"), (21, "7 pushes")])
def test_few_pushes_are_counted_and_nobody_is_told_to_learn(rows: int, count: str) -> None:
    (finding,) = pushed_part(TABLE.take(np.arange(rows)))
    assert finding.sentence.startswith(f"The data contain {count} only.") and "learnt" not in finding.text
    assert finding.advice == MEANING and finding.severity == "warning"
    assert finding.name == "pushed_part"


def test_all_that_is_missing_is_one_warning() -> None:
    (finding,) = pushed_part(of_angles(0.05).take(np.arange(12)))
    assert finding.text.count(MEANING) == 1
    assert finding.text.index("4 pushes only") < finding.text.index("push angles span")


def test_sides_need_the_outline() -> None:
    """A hexagon without symmetry has six kinds of sides; the table has pushes on its first."""
    outline = shape_outline("hex")
    uneven = replace(outline, vertices=outline.vertices * [1.0, 1.2])
    one_side = replace(TABLE, inputs=TABLE.inputs * [1.0, 0.1, 1.0])
    assert pushed_part(one_side) == []
    (finding,) = pushed_part(one_side, replace(RIG, outline=uneven))
    assert "Pushed: side 1 of 6" in finding.sentence
