# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Measurement errors: found from the gap between pusher and outline, sized, and corrected in the stream."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest

from push_predictor.geometry.frames import rotate
from push_predictor.geometry.shapes import shape_outline
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable, concatenate
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.residuals.channels.contrast import ChannelFinding
from push_predictor.residuals.channels.measurement import (
    CORRECTIONS,
    _geometry,
    _off_corners,
    correct,
    gap_responses,
    measurement_errors,
)
from push_predictor.simulation.rig_simulator import SimulationSpec, random_pushes, simulate
from push_predictor.simulation.spec import simulated_rig

PUSHES = 40
PLANTED = [
    ("clock_offset", (0.005,)),
    ("clock_offset", (-0.02,)),
    ("frame_rotation", (-np.deg2rad(2.0),)),
    ("frame_shift", (0.0006, -0.0008)),
]
UNIT = {"clock_offset": 0.0025, "frame_rotation": 0.002, "frame_shift": 0.00025}  # how near an estimate must come


def spec(seed: int, contact_friction: float = 0.25) -> SimulationSpec:
    pushes = random_pushes(PUSHES, (0.02, 0.05), travel=0.025, rng=np.random.default_rng(seed))
    return SimulationSpec("rect1", "plywood", pushes, seed=seed, contact_friction=contact_friction)


RIG = simulated_rig(spec(0))


@cache
def recorded(seed: int, contact_friction: float = 0.25) -> Recording:
    return simulate(spec(seed, contact_friction))


def windows(recording: Recording) -> PushTable:
    return windows_to_table(find_windows(recording, RIG))


@cache
def clean(seed: int) -> PushTable:
    return windows(recorded(seed))


def training() -> PushTable:
    return clean(1)


def planted(recording: Recording, mechanism: str, values: tuple[float, ...]) -> Recording:
    """The recording with an error in its streams, made by correcting the negative of the error."""
    return correct(recording, mechanism, [-value for value in values])


@cache
def with_error(mechanism: str, values: tuple[float, ...], seed: int = 2) -> PushTable:
    return windows(planted(recorded(seed), mechanism, values))


def judged(table: PushTable, baseline: PushTable | None) -> ChannelFinding:
    finding = measurement_errors(table, baseline, RIG)
    assert finding is not None
    return finding


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mechanism", "values", "compared"),
    [*((*planted, True) for planted in PLANTED), *((*planted, False) for planted in PLANTED[1:])],
)
def test_planted_error_is_named_and_sized(mechanism: str, values: tuple[float, ...], compared: bool) -> None:
    """So small a lag as the first needs more pushes than these, or those of training."""
    strongest = judged(with_error(mechanism, values), training() if compared else None).effects[0]
    assert strongest.mechanism == mechanism
    assert np.allclose(strongest.values, values, atol=UNIT[mechanism])
    assert all(parameter.low < parameter.value < parameter.high for parameter in strongest.parameters)


@pytest.mark.slow
@pytest.mark.parametrize(("mechanism", "values"), [PLANTED[1], PLANTED[3]])
def test_no_error_remains_after_correction(mechanism: str, values: tuple[float, ...]) -> None:
    right = planted(recorded(2), mechanism, values)
    for error in judged(with_error(mechanism, values), training()).effects:
        right = correct(right, error.mechanism, error.values)
    assert judged(windows(right), training()).effects == ()
    assert "corrected for" in right.notes[-1]


def test_tool_offset_is_a_rival_of_the_opposite_frame_shift() -> None:
    finding = judged(with_error("tool_offset", (0.0, 0.0008)), training())
    assert finding.effects[0].mechanism == "frame_shift"
    assert "tool_offset" in finding.effects[0].rivals
    assert np.allclose(finding.effects[0].values, (0.0, -0.0008), atol=UNIT["frame_shift"])


def test_clean_recording_has_no_error() -> None:
    assert judged(clean(2), training()).effects == ()
    assert judged(clean(2), None).effects == ()


@pytest.mark.slow
def test_change_of_contact_friction_is_not_a_measurement_error() -> None:
    assert judged(windows(recorded(4, contact_friction=0.5)), training()).effects == ()


def test_error_that_training_has_too_is_not_reported() -> None:
    both = [windows(planted(recorded(seed), "frame_shift", (0.001, 0.0))) for seed in (1, 2)]
    by_itself, as_before = ({t.mechanism: t.p_value for t in judged(both[1], base).tested} for base in (None, both[0]))
    assert by_itself["frame_shift"] < 0.05 < as_before["frame_shift"]  # 40 pushes alone do not reach a percent
    assert judged(both[1], both[0]).effects == ()


def test_smaller_pusher_radius_is_not_a_measurement_error() -> None:
    table = clean(2)
    gap = table.covariates["contact_gap"] - 0.001
    worn = replace(table, covariates={**table.covariates, "contact_gap": gap})
    assert judged(worn, training()).effects == ()


def test_error_that_is_certain_but_smaller_than_the_noise_of_a_window_is_not_reported() -> None:
    table = concatenate([replace(clean(2), push_id=np.char.add(f"{k}-", clean(2).push_id)) for k in range(6)])
    response = gap_responses(table, RIG.outline)["frame_shift"][:, 0]
    noise = 0.0004 * np.random.default_rng(1).standard_normal(len(table))
    for shift, reported in ((0.0004, False), (0.001, True)):
        off = {**table.covariates, "contact_gap": shift * response + noise}
        finding = judged(replace(table, covariates=off), None)
        assert {t.mechanism: t.p_value for t in finding.tested}["frame_shift"] <= 0.01
        assert bool(finding.effects) == reported


def test_contacts_close_to_a_corner_are_not_judged_and_a_smooth_outline_has_none() -> None:
    table, near = clean(2), 0.0015 / RIG.outline.perimeter
    inputs = table.inputs.copy()
    inputs[:, 1] = np.where(np.arange(len(table)) % 2, 0.25 + near, 0.25 + 3.0 * near)
    moved = replace(table, inputs=inputs)
    assert len(_off_corners(moved, RIG.outline)) == -(-len(table) // 2)
    assert len(_off_corners(table, shape_outline("ellip2"))) == len(table)
    around = _geometry(table, shape_outline("ellip2"))  # three waves along the outline, rather than a line
    waves = np.cos(6.0 * np.pi * table.inputs[:, 1])
    np.testing.assert_allclose(around @ np.linalg.lstsq(around, waves, rcond=None)[0], waves, atol=1e-9)


def test_windows_without_a_gap_give_no_finding() -> None:
    table = clean(2)
    assert measurement_errors(replace(table, covariates={}), training(), RIG) is None


def test_responses_match_the_geometry() -> None:
    """A gap recomputed at a displaced pose opens by the response, to first order."""
    table = clean(2)
    fraction = RIG.outline.edge(table.inputs[:, 1])[1]
    table = table.take(np.abs(fraction - 0.5) < 0.4)
    c, contact = table.covariates, table.inputs[:, 1]
    pose = np.column_stack([c["slider_x"], c["slider_y"], c["slider_heading"]])
    touch = pose[:, :2] + rotate(RIG.outline.point(contact), pose[:, 2])
    tip = touch - RIG.pusher_radius * rotate(RIG.outline.inward_normal(contact), pose[:, 2])

    def gap(x: float, y: float, turn: float) -> np.ndarray:
        place = rotate(pose[:, :2], np.array(turn)) + [x, y]
        return RIG.outline.project(rotate(tip - place, -pose[:, 2] - turn)).distance - RIG.pusher_radius

    responses = gap_responses(table, RIG.outline)
    step = 1e-6
    assert np.allclose(gap(step, 0.0, 0.0) / step, responses["frame_shift"][:, 0], atol=1e-6)
    assert np.allclose(gap(0.0, step, 0.0) / step, responses["frame_shift"][:, 1], atol=1e-6)
    assert np.allclose(gap(0.0, 0.0, step) / step, responses["frame_rotation"][:, 0], atol=1e-6)


def test_clock_response_is_zero_in_the_first_window() -> None:
    """Just before, the slider was at rest, and a late stream still shows that."""
    table = clean(2)
    first = table.covariates["time_since_contact"] < 0.03
    lag = gap_responses(table, RIG.outline)["clock_offset"][:, 0]
    assert np.all(lag[first] == 0.0)
    assert np.allclose(lag[~first], -(table.inputs[:, 0] * np.cos(table.inputs[:, 2]))[~first])


# --- corrections ------------------------------------------------------------------------------------------------------


def late(r: Recording) -> Recording:
    return replace(r, slider=replace(r.slider, stamp=r.slider.stamp + 12_000_000))


def turned(r: Recording) -> Recording:
    x, y = rotate(np.column_stack([r.slider.x, r.slider.y]), np.array(0.2)).T
    return replace(r, slider=replace(r.slider, x=x, y=y, heading=r.slider.heading + 0.2))


def moved(r: Recording) -> Recording:
    return replace(r, slider=replace(r.slider, x=r.slider.x + 0.003, y=r.slider.y - 0.001))


def offset(r: Recording) -> Recording:
    return replace(r, pusher=replace(r.pusher, x=r.pusher.x + 0.002, y=r.pusher.y + 0.004))


def biased(r: Recording) -> Recording:
    assert r.wrench is not None
    return replace(r, wrench=replace(r.wrench, fx=r.wrench.fx + 0.4, fy=r.wrench.fy - 0.3))


FAULTS: dict[str, tuple[Callable[[Recording], Recording], tuple[float, ...]]] = {
    "clock_offset": (late, (0.012,)),
    "frame_rotation": (turned, (0.2,)),
    "frame_shift": (moved, (0.003, -0.001)),
    "tool_offset": (offset, (0.002, 0.004)),
    "wrench_bias": (biased, (0.4, -0.3)),
}


@pytest.mark.parametrize("mechanism", CORRECTIONS)
def test_the_corrected_recording_is_the_one_without_the_error(mechanism: str, recording: Recording) -> None:
    fault, values = FAULTS[mechanism]
    corrected = correct(fault(recording), mechanism, values)
    for name in ("slider", "pusher", "wrench"):
        found, expected = getattr(corrected, name), getattr(recording, name)
        for field in fields(expected):
            if getattr(expected, field.name) is not None:
                assert np.allclose(getattr(found, field.name), getattr(expected, field.name), rtol=0.0, atol=1e-12)
    assert mechanism in corrected.notes[-1]


def test_a_bias_of_an_absent_wrench_changes_nothing(recording: Recording) -> None:
    bare = replace(recording, wrench=None)
    assert correct(bare, "wrench_bias", (0.4, -0.3)).wrench is None
