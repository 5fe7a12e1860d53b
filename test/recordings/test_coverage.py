# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The coverage of a push table, in findings and in words; where the contacts of a recording lie against its outline."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from checked_bags import bag
from mistakes import outline_scaled, stream_part
from repository import REPOSITORY
from synthetic import square_pushes

from push_predictor.geometry.outline import Outline
from push_predictor.geometry.shapes import shape_outline
from push_predictor.recordings.checks.coverage import (
    MEANING,
    ContactFit,
    Coverage,
    contact_fit,
    coverage_findings,
    coverage_of,
    pushed_part,
)
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.checks.motion import motion_of
from push_predictor.recordings.load import load_data
from push_predictor.recordings.read import require_rig
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording, taken
from push_predictor.recordings.table import PushTable, empty_table
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table

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
    return coverage_of(table, rig_with(outline))


def found(table: PushTable, outline: Outline | None = SQUARE) -> dict[str, Finding]:
    return {finding.name: finding for finding in coverage_findings(coverage_of(table, outline and rig_with(outline)))}


def on_sides(table: PushTable, *sides: int) -> PushTable:
    return table.take(np.isin(np.floor(4.0 * table.inputs[:, 1]), sides))


def with_inputs(table: PushTable, column: int, scale: float, middle: float = 0.0) -> PushTable:
    inputs = table.inputs.copy()
    inputs[:, column] = middle + scale * (inputs[:, column] - middle)
    return replace(table, inputs=inputs)


def sticking(share: float, slip: float) -> PushTable:
    """All pushes but a share of them stick; slip: of those, in path lengths of the tip."""
    table, stuck = pushes(), pushes(slip=slip)
    sliding = np.arange(len(table)) // WINDOWS % 10 < 10 * share
    return replace(table, inputs=np.where(sliding[:, None], table.inputs, stuck.inputs))


@pytest.mark.parametrize(
    ("table", "outline", "name", "severity", "words"),
    [
        (empty_table(), SQUARE, "no_pushes", "warning", "nothing can be learnt"),
        (pushes(7), SQUARE, "few_pushes", "warning", "at least 23 more"),
        (pushes(8), SQUARE, "few_pushes", "note", "at least 22 more"),
        (pushes(29), SQUARE, "few_pushes", "note", "at least 1 more"),
        (on_sides(pushes(), 0, 2), SQUARE, "few_sides", "note", "sides 1, 3 of 4, counter-clockwise"),
        (on_sides(pushes(), 0, 2), SQUARE, "few_sides", "note", "Push sides 2, 4 too"),
        (on_sides(pushes(), 0, 2), RECTANGLE, "few_sides", "warning", "sides 1, 3"),  # the long sides alone
        (on_sides(pushes(), 0, 1), RECTANGLE, "few_sides", "note", "sides 1, 2"),
        (on_sides(pushes(), 0, 1), shape_outline("ellip3"), "few_sides", "note", "quarters 1, 2 of 4"),
        (with_inputs(pushes(), 0, 0.01, 0.02), SQUARE, "one_speed", "note", "mm/s"),
        (with_inputs(pushes(), 2, 0.2), SQUARE, "few_angles", "warning", "-60 to 60 degrees"),
        (with_inputs(pushes(), 2, 0.4), SQUARE, "few_angles", "note", "-60 to 60 degrees"),
        (sticking(0.0, 0.18), SQUARE, "few_sliding", "warning", "in 0 %"),  # each step against the path of its push
        (sticking(0.1, 0.05), SQUARE, "few_sliding", "note", "slides"),
    ],
)
def test_what_is_missing_is_named(table: PushTable, outline: Outline, name: str, severity: str, words: str) -> None:
    finding = found(table, outline)[name]
    assert finding.severity == severity and words in finding.text


def test_pushes_of_all_kinds_have_no_finding_and_a_circle_has_no_sides() -> None:
    assert found(pushes()) == {}
    assert "few_sides" not in found(on_sides(pushes(), 0, 1), shape_outline("ellip1"))


def test_a_contact_slides_either_way_from_one_window_of_a_push_to_the_next() -> None:
    table, steps = pushes(), np.arange(80 * WINDOWS)
    assert covered(table).sliding == covered(pushes(slip=-0.5)).sliding == 1.0
    assert covered(replace(table, covariates={"elapsed_time": 0.2 * steps})).sliding == 1.0
    assert covered(replace(table, covariates={"elapsed_time": 0.01 * steps})).sliding is None  # they overlap
    assert covered(replace(table, push_id=steps.astype(str))).sliding is None


def test_a_contact_that_rolls_around_the_tip_does_not_slide() -> None:
    """A slider that turns by 0.3 rad, to either side, moves its contact by 0.3 radii of the tip, without slip."""
    turn = np.repeat(0.3 * (-1.0) ** np.arange(80), WINDOWS)
    table = pushes(slip=0.0)
    table = replace(table, outcomes=table.outcomes + np.outer(turn, [0.0, 0.0, 1.0]))
    rolled = turn * RADIUS / SQUARE.perimeter * np.tile(np.arange(WINDOWS), 80)
    inputs = table.inputs - np.column_stack([0.0 * rolled, rolled, 0.0 * rolled])
    assert covered(replace(table, inputs=inputs)).sliding == 0.0
    assert covered(table).sliding != 0.0


def test_without_an_outline_sides_and_sliding_are_unknown() -> None:
    coverage = coverage_of(pushes())
    assert coverage is not None and coverage.side_counts is None and coverage.sliding is None
    assert found(on_sides(pushes(), 0), None) == {"few_pushes": found(on_sides(pushes(), 0), None)["few_pushes"]}


# --- what pushes leave out of the domain where they judge a model -----------------------------------------------------


TABLE, RIG = square_pushes(90)
HEXAGON = REPOSITORY / "bags" / "hexagon_delrin"


def of_angles(scale: float) -> PushTable:
    return replace(TABLE, inputs=TABLE.inputs * [1.0, 1.0, scale])


def test_pushes_all_around_give_no_warning() -> None:
    assert pushed_part(TABLE, RIG) == [] and pushed_part(TABLE) == []
    assert pushed_part(empty_table(), RIG) == []
    assert pushed_part(load_data([HEXAGON]), bag("hexagon_delrin").rig) == []


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


# --- contacts against the outline, and how much of their time became windows ------------------------------------------


APOTHEM = 0.0605 * np.sqrt(0.75)  # m, of the hexagon


def hexagon() -> Recording:
    return bag("hexagon_delrin")


def fit_of(recording: Recording, rig: Rig) -> ContactFit:
    return contact_fit(motion_of(recording, rig), rig)


@pytest.mark.parametrize("size", [0.96, 1.0, 1.04])
def test_gaps_have_the_size_and_sign_of_the_outlines_error(size: float) -> None:
    fit = fit_of(hexagon(), outline_scaled(require_rig(hexagon()), size))
    assert fit.side == "side" and len(fit.gaps) == 6
    for gap in fit.gaps:
        assert gap == pytest.approx(APOTHEM * (1.0 - size), abs=2e-4)
    assert (fit.inside, fit.off) == pytest.approx((float(size > 1.0), float(size < 1.0)), abs=0.01)
    assert min(fit.inside, fit.off) == 0.0


def test_a_side_without_contact_has_no_gap() -> None:
    """The bag begins with pushes on some sides."""
    half = replace(hexagon(), slider=stream_part(hexagon().slider, 0.0, 0.3))
    fit = fit_of(half, require_rig(hexagon()))
    assert 0 < sum(gap is None for gap in fit.gaps) < 6
    assert fit.lost is None and fit.window_time is None


def test_the_time_in_contact_is_that_of_the_samples_without_dropouts() -> None:
    fit = fit_of(hexagon(), require_rig(hexagon()))
    assert fit.contact_time == pytest.approx(fit.samples / 100.0, rel=0.02)
    slider = hexagon().slider
    gone = np.ones(len(slider), dtype=np.bool_)
    gone[400:700] = False
    fewer = fit_of(replace(hexagon(), slider=taken(slider, gone)), require_rig(hexagon()))
    assert fewer.contact_time == pytest.approx(fewer.samples / 100.0, rel=0.02)


def test_windows_use_the_time_in_contact_but_for_the_ends_of_pushes() -> None:
    rig = require_rig(hexagon())
    table = windows_to_table(find_windows(hexagon(), rig))
    fit = contact_fit(motion_of(hexagon(), rig), rig, table)
    assert fit is not None and fit.window_time == pytest.approx(0.2 * len(table)) and fit.lost is not None
    assert 0.0 < fit.lost < 0.2 * len(table.pushes) / fit.contact_time
    half = contact_fit(motion_of(hexagon(), rig), rig, table.take(np.arange(len(table)) < len(table) // 2))
    assert half is not None and half.lost == pytest.approx(0.5 + 0.5 * fit.lost, abs=0.02)
    slider = hexagon().slider
    still = replace(slider, x=0.0 * slider.x, y=0.0 * slider.y, heading=0.0 * slider.x)
    assert contact_fit(motion_of(replace(hexagon(), slider=still), rig), rig) is None
