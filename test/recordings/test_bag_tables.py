# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of windows of bags/: sound as they are; coverage that they lack, and signs that are wrong, are named."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mistakes import BAGS, force_of_another_time, mirrored
from repository import REPOSITORY

from push_predictor.geometry.shapes import transformed
from push_predictor.recordings.checks.check import CheckedData, checked_data, checked_recording
from push_predictor.recordings.checks.coverage import coverage_findings
from push_predictor.recordings.checks.units import check_table
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable

SMALL = "ellipse_plywood"
WHOLE = "square_abs_test"  # on all sides, at several speeds and angles
SLIDERS = [name for name in BAGS if name != "square_abs_train"]
TWO = ("circle_pu", "square_abs_repeats")  # round, and pushed on one side
Change = Callable[[PushTable], PushTable]


@cache
def checked(name: str) -> CheckedData:
    return checked_data(REPOSITORY / "bags" / name)


def table_of(name: str) -> PushTable:
    table = checked(name).table
    assert table is not None
    return table


def rig_of(name: str) -> Rig:
    rig = checked(name).rig
    assert rig is not None
    return rig


def changed(table: PushTable, dy: float = 1.0, dtheta: float = 1.0, angle: float = 1.0) -> PushTable:
    return replace(table, inputs=table.inputs * [1.0, 1.0, angle], outcomes=table.outcomes * [1.0, dy, dtheta])


def clockwise_contacts(table: PushTable) -> PushTable:
    velocity, contact, angle = table.inputs.T
    return replace(table, inputs=np.column_stack([velocity, (1.0 - contact) % 1.0, angle]))


# --- coverage --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*SLIDERS, pytest.param("square_abs_train", marks=pytest.mark.long)])
def test_no_bag_gives_a_warning(name: str) -> None:
    coverage = checked(name).coverage
    assert coverage is not None and coverage.sliding is not None
    assert [each for each in checked(name).findings if each not in coverage_findings(coverage)] == []
    assert {finding.severity for finding in checked(name).findings} <= {"note"}
    assert coverage.sliding > 0.3


# --- signs -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TWO)
@pytest.mark.parametrize(
    ("change", "finding"),
    [
        (lambda table: changed(table, dy=-1.0, dtheta=-1.0), "table_mirrored"),
        (lambda table: changed(table, dy=-1.0), "dy_sign"),
        (lambda table: changed(table, dtheta=-1.0), "dtheta_sign"),
    ],
)
def test_a_mirrored_table_is_named(name: str, change: Change, finding: str) -> None:
    (found,) = check_table(change(table_of(name)), rig_of(name))
    assert (found.name, found.severity) == (finding, "warning")
    assert all(value.value < -0.9 for value in found.values.values())


@pytest.mark.parametrize("name", TWO)
def test_without_a_rig_the_sign_of_dy_is_checked(name: str) -> None:
    assert check_table(table_of(name)) == ()
    (found,) = check_table(changed(table_of(name), dy=-1.0, dtheta=-1.0))
    assert found.name == "dy_sign"


def test_clockwise_contacts_and_angles_are_named() -> None:
    table, rig = table_of("square_abs_test"), rig_of("square_abs_test")
    assert [each.name for each in check_table(clockwise_contacts(table), rig)] == ["dtheta_sign"]
    assert "dy_sign" in [each.name for each in check_table(changed(table, angle=-1.0))]
    seen_from_below = clockwise_contacts(changed(table, -1.0, -1.0, -1.0))
    assert check_table(seen_from_below, rig) == ()  # consistent in itself, and the square is symmetric


def test_a_rotation_is_judged_about_the_centroid_wherever_the_origin_of_the_outline_is() -> None:
    table, rig = table_of("square_abs_test"), rig_of("square_abs_test")
    shifted = replace(rig, outline=transformed(rig.outline, shift=(0.3, -0.2)))
    assert check_table(table, shifted) == ()
    assert [each.name for each in check_table(changed(table, dtheta=-1.0), shifted)] == ["dtheta_sign"]


def test_few_rows_or_rows_in_the_friction_cone_decide_nothing() -> None:
    wrong = changed(table_of(WHOLE), dy=-1.0)
    steep = np.flatnonzero(np.abs(wrong.inputs[:, 2]) > np.radians(30.0))
    assert check_table(wrong.take(steep[:9])) == () != check_table(wrong.take(steep[:10]))
    assert check_table(wrong.take(np.abs(wrong.inputs[:, 2]) < np.radians(24.0))) == ()


def test_outcomes_of_either_sign_are_no_finding() -> None:
    """A sign is wrong only if most of dy is."""
    table = table_of(WHOLE)
    signs = np.where(np.arange(len(table)) % 10 < 6, -1.0, 1.0)
    assert check_table(replace(table, outcomes=table.outcomes * np.column_stack([signs**2, signs, signs]))) == ()


def test_the_heading_of_a_circle_is_checked_by_its_windows() -> None:
    """Its contacts lie on the outline, whatever the heading is."""
    recording = read_recording(REPOSITORY / "bags" / "circle_pu")
    found = checked_recording(mirrored(recording, 1.0, -1.0)).findings
    assert [each.name for each in found if each.severity == "warning"] == ["dtheta_sign"]


@pytest.mark.parametrize(("name", "some"), [(SMALL, 11), ("hexagon_delrin", None)])
def test_a_wrench_that_hides_pushes_is_left_out_of_the_coverage(name: str, some: int | None) -> None:
    """The geometry shows contacts that the force does not: the advice is about the wrench, not about missing pushes."""
    hiding = checked_recording(force_of_another_time(read_recording(REPOSITORY / "bags" / name)))
    sound = checked(name)
    assert hiding.coverage is not None and sound.coverage is not None
    assert hiding.coverage.pushes >= sound.coverage.pushes
    (finding,) = (each for each in hiding.findings if each.name == "wrench_unrelated")
    assert "`--wrench-topic none`" in finding.advice
    hidden = re.search(r"contact is found in (\d+) of (\d+) pushes", finding.advice)
    assert (hidden is None and some is None) or (hidden is not None and int(hidden[1]) == some)
