"""Errors of measurement: told by the gap between tip and outline, sized, corrected in the stream, never made up."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from push_predictor.geometry.frames import rotate
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.residuals.channels.corrections import correct
from push_predictor.residuals.channels.measurement import MeasurementFinding, gap_responses, measurement_errors
from push_predictor.simulation.rig_simulator import SimulationSpec, random_pushes, simulate
from push_predictor.simulation.spec import simulated_rig

PUSHES = 40
PLANTED = [
    ("clock_offset", (0.005,)),
    ("clock_offset", (-0.02,)),
    ("frame_rotation", (np.deg2rad(1.0),)),
    ("frame_rotation", (-np.deg2rad(2.0),)),
    ("frame_shift", (0.0005, 0.0)),
    ("frame_shift", (0.0006, -0.0008)),
]
UNIT = {"clock_offset": 0.0025, "frame_rotation": 0.002, "frame_shift": 0.00025}  # how near an estimate must come


def spec(seed: int, contact_friction: float = 0.25) -> SimulationSpec:
    pushes = random_pushes(PUSHES, (0.02, 0.05), rng=np.random.default_rng(seed))
    return SimulationSpec("rect1", "plywood", pushes, seed=seed, contact_friction=contact_friction)


RIG = simulated_rig(spec(0))


@cache
def recorded(seed: int, contact_friction: float = 0.25) -> Recording:
    return simulate(spec(seed, contact_friction))


def windows(recording: Recording) -> PushTable:
    return windows_to_table(find_windows(recording, RIG))


@cache
def training() -> PushTable:
    return windows(recorded(1))


def planted(recording: Recording, mechanism: str, values: tuple[float, ...]) -> Recording:
    """The recording with the error in its streams: what a correction by the negative would make of it."""
    return correct(recording, mechanism, [-value for value in values])


def judged(table: PushTable, baseline: PushTable | None) -> MeasurementFinding:
    finding = measurement_errors(table, baseline, RIG)
    assert finding is not None
    return finding


def assert_told(finding: MeasurementFinding, mechanism: str, values: tuple[float, ...]) -> None:
    strongest = finding.errors[0]
    assert strongest.mechanism == mechanism
    assert np.allclose(strongest.values, values, atol=UNIT[mechanism])
    assert all(parameter.low < parameter.value < parameter.high for parameter in strongest.parameters)


@pytest.mark.parametrize(("mechanism", "values"), PLANTED)
def test_an_error_planted_in_the_stream_is_named_and_sized(mechanism: str, values: tuple[float, ...]) -> None:
    assert_told(judged(windows(planted(recorded(2), mechanism, values)), training()), mechanism, values)


@pytest.mark.parametrize(("mechanism", "values"), [PLANTED[1], PLANTED[3], PLANTED[5]])
def test_it_is_told_without_training_windows_too(mechanism: str, values: tuple[float, ...]) -> None:
    """Half a millimetre would take more pushes than these."""
    assert_told(judged(windows(planted(recorded(2), mechanism, values)), None), mechanism, values)


@pytest.mark.parametrize(("mechanism", "values"), [PLANTED[1], PLANTED[5]])
def test_once_corrected_and_cut_again_nothing_is_left(mechanism: str, values: tuple[float, ...]) -> None:
    wrong = planted(recorded(2), mechanism, values)
    right = wrong
    for error in judged(windows(wrong), training()).errors:
        right = correct(right, error.mechanism, error.values)
    assert judged(windows(right), training()).errors == ()
    assert "corrected for" in right.notes[-1]


def test_a_tool_offset_is_a_frame_shift_as_long_as_the_tool_does_not_turn() -> None:
    finding = judged(windows(planted(recorded(2), "tool_offset", (0.0, 0.0008))), training())
    assert finding.errors[0].mechanism == "frame_shift"
    assert "tool_offset" in finding.errors[0].rivals
    assert np.allclose(finding.errors[0].values, (0.0, -0.0008), atol=UNIT["frame_shift"])


@pytest.mark.parametrize("seed", [2, 3])
def test_a_clean_recording_has_no_error(seed: int) -> None:
    assert judged(windows(recorded(seed)), training()).errors == ()
    assert judged(windows(recorded(seed)), None).errors == ()


def test_a_change_of_the_motion_is_no_error_of_measurement() -> None:
    assert judged(windows(recorded(4, contact_friction=0.5)), training()).errors == ()


def test_an_error_that_the_training_windows_have_too_is_no_news() -> None:
    both = [windows(planted(recorded(seed), "frame_shift", (0.001, 0.0))) for seed in (1, 2)]
    by_itself, as_before = ({t.mechanism: t.p_value for t in judged(both[1], base).tested} for base in (None, both[0]))
    assert by_itself["frame_shift"] < 0.05 < as_before["frame_shift"]  # 40 pushes alone do not reach a percent
    assert judged(both[1], both[0]).errors == ()


def test_a_worn_tip_is_geometry_and_none_of_these() -> None:
    table = windows(recorded(2))
    gap = table.covariates["contact_gap"] - 0.001
    worn = replace(table, covariates={**table.covariates, "contact_gap": gap})
    assert judged(worn, training()).errors == ()


def test_an_error_below_the_trackers_noise_does_not_matter() -> None:
    assert judged(windows(planted(recorded(2), "clock_offset", (0.0003,))), training()).errors == ()


def test_all_that_was_tried_is_told() -> None:
    tested = {t.mechanism: t.p_value for t in judged(windows(recorded(2)), training()).tested}
    assert set(tested) == {"clock_offset", "frame_rotation", "frame_shift"}
    assert all(0.0 < p <= 1.0 for p in tested.values())


def test_windows_without_a_gap_tell_nothing() -> None:
    table = windows(recorded(2))
    assert measurement_errors(replace(table, covariates={}), training(), RIG) is None


def test_the_responses_are_what_the_geometry_says() -> None:
    """Tip and outline computed anew at a displaced pose open the gap by the response, to first order."""
    table = windows(recorded(2))
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


def test_the_clock_is_not_judged_at_the_touch() -> None:
    """There the slider was at rest a moment before, and a late stream still shows that."""
    table = windows(recorded(2))
    first = table.covariates["time_since_contact"] < 0.03
    lag = gap_responses(table, RIG.outline)["clock_offset"][:, 0]
    assert np.all(lag[first] == 0.0)
    assert np.allclose(lag[~first], -(table.inputs[:, 0] * np.cos(table.inputs[:, 2]))[~first])


@pytest.mark.parametrize(
    ("mechanism", "values"),
    [*PLANTED, ("tool_offset", (0.001, 0.002)), ("wrench_bias", (0.3, -0.1))],
)
def test_a_correction_is_undone_by_its_negative(mechanism: str, values: tuple[float, ...]) -> None:
    recording = recorded(2)
    back = correct(planted(recording, mechanism, values), mechanism, values)
    for name in ("stamp", "x", "y"):
        for stream in ("slider", "pusher"):
            assert np.allclose(getattr(getattr(back, stream), name), getattr(getattr(recording, stream), name))
    assert np.allclose(np.exp(1j * back.slider.heading), np.exp(1j * recording.slider.heading))
    assert back.wrench is not None and recording.wrench is not None
    assert np.allclose(back.wrench.fx, recording.wrench.fx)


def test_a_mechanism_that_is_not_known_is_refused() -> None:
    with pytest.raises(KeyError):
        correct(recorded(2), "contact_friction", (0.1,))
