# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The coverage of a push table: what is missing is named, with what to record next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import shape_outline
from push_predictor.recordings.checks.coverage import Coverage, coverage_findings, coverage_of
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable, empty_table

SQUARE, RADIUS = shape_outline("rect1"), 0.00475
RECTANGLE = Outline(np.array([[-0.06, -0.03], [0.06, -0.03], [0.06, 0.03], [-0.06, 0.03]]))
WINDOWS = 5  # of each push


def pushes(count: int = 80, slip: float = 0.5) -> PushTable:
    """Pushes on all sides, at speeds and angles of a wide range. slip: of each step, in path lengths of the tip."""
    draw, n = np.random.default_rng(0), count * WINDOWS
    velocity = np.repeat(draw.uniform(0.01, 0.1, count), WINDOWS)
    angle = np.repeat(draw.uniform(-1.0, 1.0, count), WINDOWS)
    step = slip * velocity * 0.2 / SQUARE.perimeter * np.tile(np.arange(WINDOWS), count)
    contact = (np.repeat(np.arange(count) % 4 / 4.0 + 0.05, WINDOWS) + step) % 1.0
    outcomes = np.column_stack([velocity * 0.2, np.zeros((n, 2))])
    names = np.repeat(np.arange(count).astype(str), WINDOWS)
    return PushTable(np.column_stack([velocity, contact, angle]), np.full(n, 0.2), outcomes, names)


def rig_with(outline: Outline) -> Rig:
    return Rig("shape", outline, RADIUS, "unknown")


def covered(table: PushTable, outline: Outline = SQUARE) -> Coverage:
    coverage = coverage_of(table, rig_with(outline))
    assert coverage is not None
    return coverage


def found(table: PushTable, outline: Outline | None = SQUARE) -> dict[str, Finding]:
    return {finding.name: finding for finding in coverage_findings(coverage_of(table, outline and rig_with(outline)))}


def on_sides(table: PushTable, *sides: int) -> PushTable:
    return table.take(np.isin(np.floor(4.0 * table.inputs[:, 1]), sides))


def with_inputs(table: PushTable, column: int, scale: float, middle: float = 0.0) -> PushTable:
    inputs = table.inputs.copy()
    inputs[:, column] = middle + scale * (inputs[:, column] - middle)
    return replace(table, inputs=inputs)


def test_pushes_of_all_kinds_give_no_finding() -> None:
    assert found(pushes()) == {}


@pytest.mark.parametrize(("count", "severity"), [(7, "warning"), (8, "note"), (29, "note")])
def test_few_pushes_are_counted(count: int, severity: str) -> None:
    finding = found(pushes(count))["few_pushes"]
    assert finding.severity == severity
    assert f"at least {30 - count} more" in finding.advice


def test_no_push_at_all_is_a_warning() -> None:
    assert [finding.name for finding in coverage_findings(coverage_of(empty_table(), rig_with(SQUARE)))] == [
        "no_pushes"
    ]


def test_missing_sides_of_a_square_are_a_note_and_named() -> None:
    finding = found(on_sides(pushes(), 0, 2))["few_sides"]
    assert finding.severity == "note"
    assert "sides 1 and 3 of 4" in finding.sentence and "Push sides 2 and 4 too" in finding.advice


def test_a_kind_of_side_that_was_never_pushed_is_a_warning() -> None:
    assert found(on_sides(pushes(), 0, 2), RECTANGLE)["few_sides"].severity == "warning"  # the long sides alone
    assert found(on_sides(pushes(), 0, 1), RECTANGLE)["few_sides"].severity == "note"


def test_a_smooth_outline_is_judged_by_quarters_and_a_circle_not_at_all() -> None:
    half = on_sides(pushes(), 0, 1)
    assert "quarters 1 and 2 of 4" in found(half, shape_outline("ellip3"))["few_sides"].sentence
    assert "few_sides" not in found(half, shape_outline("ellip1"))


def test_one_speed_is_a_note() -> None:
    finding = found(with_inputs(pushes(), 0, 0.01, 0.02))["one_speed"]
    assert finding.severity == "note" and "mm/s" in finding.sentence


@pytest.mark.parametrize(("share", "severity"), [(0.2, "warning"), (0.4, "note")])
def test_a_small_range_of_angles_is_found(share: float, severity: str) -> None:
    finding = found(with_inputs(pushes(), 2, share))["few_angles"]
    assert finding.severity == severity and "-60 to 60 degrees" in finding.advice


def test_contacts_that_stick_are_found() -> None:
    assert found(pushes(slip=0.18))["few_sliding"].severity == "warning"  # each step against the path of its own push
    mixed = pushes()
    sliding = np.arange(len(mixed)) // WINDOWS % 10 == 0
    inputs = np.where(sliding[:, None], mixed.inputs, pushes(slip=0.05).inputs)
    assert found(replace(mixed, inputs=inputs))["few_sliding"].severity == "note"


def test_a_contact_that_rolls_around_the_tip_does_not_slide() -> None:
    """A slider that turns by 0.3 rad, to either side, moves its contact by 0.3 radii of the tip, without slip."""
    turn = np.repeat(0.3 * (-1.0) ** np.arange(80), WINDOWS)
    table = pushes(slip=0.0)
    table = replace(table, outcomes=table.outcomes + np.outer(turn, [0.0, 0.0, 1.0]))
    rolled = turn * RADIUS / SQUARE.perimeter * np.tile(np.arange(WINDOWS), 80)
    inputs = table.inputs - np.column_stack([0.0 * rolled, rolled, 0.0 * rolled])
    assert covered(replace(table, inputs=inputs)).sliding == 0.0
    assert covered(table).sliding != 0.0


def test_windows_that_overlap_say_nothing_about_sliding() -> None:
    table = pushes()
    assert covered(replace(table, covariates={"elapsed_time": 0.01 * np.arange(len(table))})).sliding is None
    assert covered(replace(table, covariates={"elapsed_time": 0.2 * np.arange(len(table))})).sliding == 1.0


def test_a_contact_slides_in_either_direction() -> None:
    assert covered(pushes(slip=0.5)).sliding == covered(pushes(slip=-0.5)).sliding == 1.0


def test_without_an_outline_sides_and_sliding_are_unknown() -> None:
    coverage = coverage_of(pushes())
    assert coverage is not None and coverage.side_counts is None and coverage.sliding is None
    assert found(on_sides(pushes(), 0), None) == {"few_pushes": found(on_sides(pushes(), 0), None)["few_pushes"]}


def test_rows_of_different_pushes_are_no_steps() -> None:
    table = pushes()
    assert covered(replace(table, push_id=np.arange(len(table)).astype(str))).sliding is None
