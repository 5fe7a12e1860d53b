# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Changes to the plain rig have the effects that mechanics predicts, and changes of zero have none."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from coarse import coarse_simulator
from sensed_motion import sensed

from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.simulation.batches import run_pushes
from push_predictor.simulation.changes import Changes, Conditions, Moment, Topic
from push_predictor.simulation.pushes import PushPlan, random_pushes
from push_predictor.simulation.rig_simulator import SimulationSpec, push_outcomes, simulate
from push_predictor.simulation.sensors import Faults, Sensors
from push_predictor.simulation.slider import support_points
from push_predictor.simulation.surface import Surface
from push_predictor.types import Array

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def coarsely() -> Iterator[None]:
    """The errors are far below these tests' tolerances."""
    with coarse_simulator(3.0):
        yield


GLASS = Surface("glass", 0.2, 0.0, 0.02, 0.0, 0.0)  # uniform and without noise
QUIET = Sensors(tracker_noise=0.0, heading_noise=0.0, tip_noise=0.0, dropout_interval=0.0)


def spec_of(plan: PushPlan, **options: object) -> SimulationSpec:
    return SimulationSpec("rect1", GLASS, plan, **{"place_spread": 0.0, "turn_spread": 0.0, **options})


def middle_pushes(angle: Array, speed: float = 0.02, travel: float = 0.005) -> PushPlan:
    """Pushes of a window at the middle of the lowest side."""
    n = len(angle)
    return PushPlan(np.full(n, 0.125), np.asarray(angle), np.full(n, speed), np.full(n, travel))


def some_pushes(n: int = 6) -> PushPlan:
    return random_pushes(n, [0.02], 0.006, np.random.default_rng(4), angle_limit=0.8)


def repeated(plan: PushPlan, times: int) -> PushPlan:
    """The whole plan several times."""
    return plan.take(np.tile(np.arange(len(plan)), times))


def of_push(values: Sequence[float], moment: Moment) -> Array:
    """The value of each push, from one for each row of the plan."""
    return np.asarray(values, dtype=np.float64)[moment.conditions.row]


ON_GLASS = spec_of(some_pushes())
ON_ABS = SimulationSpec("rect1", "abs", some_pushes(3), seed=3)
WITHOUT_NOISE = replace(ON_ABS, sensors=QUIET)
recording_of = cache(sensed)  # a spec is equal only to itself


def outcomes_by_push(spec: SimulationSpec) -> Array:
    """The outcome (n, 3) of the first window of each push."""
    table = push_outcomes(spec)
    return np.array([table.outcomes[table.push_id == str(row)][0] for row in range(len(spec.pushes))])


def friction_changes(values: Sequence[float]) -> Changes:
    """A change of the contact friction for each push."""
    return Changes(contact_friction=lambda moment: of_push(values, moment))


def streams(recording: Recording) -> list[Array]:
    slider, pusher, wrench = recording.slider, recording.pusher, recording.wrench
    assert wrench is not None
    of_wrench = [wrench.stamp, wrench.fx, wrench.torque]
    return [slider.stamp, slider.x, slider.y, slider.heading, pusher.x, pusher.y, *of_wrench]


def assert_same_streams(one: Recording, other: Recording) -> None:
    for ours, theirs in zip(streams(one), streams(other), strict=True):
        assert np.array_equal(ours, theirs)


def test_changes_of_zero_leave_the_recording_identical() -> None:
    none = Changes(
        contact_friction=lambda moment: np.zeros(len(moment.travelled)),
        load=lambda moment: np.zeros((len(moment.travelled), 1)),
        grip=lambda moment: np.ones(len(moment.travelled)),
        pull=lambda moment: np.zeros((len(moment.travelled), 3)),
    )
    assert_same_streams(simulate(replace(ON_ABS, changes=none)), recording_of(ON_ABS))


def test_pickled_spec_gives_the_same_recording() -> None:
    assert_same_streams(simulate(pickle.loads(pickle.dumps(ON_ABS))), recording_of(ON_ABS))


def test_directed_drag_without_anisotropy_equals_isotropic_drag() -> None:
    level = Changes(grain=lambda moment: np.zeros((len(moment.travelled), 2)))
    directed, _ = moved_and_forces(replace(ON_GLASS, changes=level))
    assert directed == pytest.approx(moved_and_forces(ON_GLASS)[0], abs=1e-9)


def test_more_contact_friction_reduces_slip() -> None:
    plan = repeated(middle_pushes(np.array([0.9, -0.9]), travel=0.009), 3)
    along_edge = _slip(spec_of(plan, changes=friction_changes([-0.15, -0.15, 0.0, 0.0, 0.2, 0.2]))).reshape(3, 2)
    assert np.all(np.diff(along_edge.mean(axis=1)) < 0.0)


def _slip(spec: SimulationSpec) -> Array:
    """Change of the contact from the first window of each push to its last, as a share of the perimeter."""
    table = push_outcomes(spec)
    by_push = [table.inputs[table.push_id == str(row), 1] for row in range(len(spec.pushes))]
    return np.array([abs(contact[-1] - contact[0]) for contact in by_push])


def test_contact_friction_is_never_negative() -> None:
    spec = spec_of(repeated(some_pushes(4), 2), changes=friction_changes([-9.0] * 4 + [-0.25] * 4))
    beyond, none = np.split(outcomes_by_push(spec), 2)
    assert beyond == pytest.approx(none, abs=1e-12)


@pytest.mark.parametrize(
    ("changes", "factor"),
    [
        (Changes(grip=lambda moment: np.full(len(moment.travelled), 0.5)), 0.5),
        (Changes(added_mass=0.4), 1.0 + 0.4 / ON_GLASS.slider.mass),
    ],
    ids=["friction", "mass"],
)
def test_friction_of_the_table_and_mass_change_the_force_but_not_the_motion(changes: Changes, factor: float) -> None:
    (plain, force), (moved, changed) = moved_and_forces(ON_GLASS), moved_and_forces(replace(ON_GLASS, changes=changes))
    assert np.max(np.abs(moved - plain)) < 0.03 * np.max(np.abs(plain))
    assert changed == pytest.approx(factor * force, rel=0.05)


@cache
def moved_and_forces(spec: SimulationSpec) -> tuple[Array, Array]:
    """Motion (n, 3) of the slider in each push, and median force (n,) during it, N."""
    (batch,) = run_pushes(spec)
    order, motion = np.argsort(batch.rows), batch.motion
    force = np.hypot(motion.wrench[..., 0], motion.wrench[..., 1])
    return (motion.slider[:, -1] - motion.slider[:, 0])[order], np.array([np.median(f[f > 0.0]) for f in force[order]])


def test_off_centre_load_turns_the_slider_to_the_other_side() -> None:
    spec = spec_of(middle_pushes(np.zeros(2)))
    x = support_points(spec.slider.outline)[:, 0]
    heading = spec.slider.outline.inward_normal(np.array([0.125]))[0]
    left = x * -heading[1] if abs(heading[1]) > 0.5 else support_points(spec.slider.outline)[:, 1] * heading[0]
    loaded = Changes(load=lambda moment: np.outer(of_push([0.0, 30.0], moment), left))
    plain, turn = outcomes_by_push(replace(spec, changes=loaded))[:, 2]
    assert abs(plain) < abs(turn)
    assert turn > 0.005  # the loaded left side lags, so the slider turns left


def test_resting_slider_stays_on_a_gentle_slope() -> None:
    spec = spec_of(middle_pushes(np.zeros(1)), changes=Changes(pull=lambda moment: np.array([[0.3, 0.3, 0.0]])))
    (batch,) = run_pushes(spec)
    untouched = batch.motion.time[0] < 0.1
    assert np.max(np.abs(batch.motion.slider[0, untouched, :2])) < 1e-4


@pytest.mark.slow
def test_viscous_drag_is_proportional_to_speed() -> None:
    drag = Changes(viscosity=lambda moment: of_push([20.0, 20.0, 0.0, 0.0], moment))
    plan = replace(middle_pushes(np.zeros(4)), speed=np.tile([0.02, 0.04], 2))
    with_it, without = np.split(moved_and_forces(spec_of(plan, changes=drag))[1], 2)
    added = with_it - without
    assert added[0] == pytest.approx(20.0 * 0.02, rel=0.15)
    assert added[1] == pytest.approx(2.0 * added[0], rel=0.15)


def test_conditions_equal_the_covariates_of_the_window_finder() -> None:
    plan = random_pushes(25, [0.02, 0.03], 0.012, np.random.default_rng(8), angle_limit=0.5)
    pauses = np.random.default_rng(1).exponential(1.0, 25)
    spec = replace(SimulationSpec("rect1", "abs", plan, seed=2), sensors=QUIET, pauses=pauses)
    spec = replace(spec, topics={"room/light": Topic(np.array([0.0, 200.0]), np.array([0.0, 100.0]))})
    seen: dict[int, Conditions] = {}

    def note(moment: Moment) -> Array:
        seen[0] = moment.conditions
        return np.zeros(len(moment.travelled))

    table = _found(simulate(replace(spec, changes=Changes(contact_friction=note))))
    first = table.take(np.unique(table.push_id, return_index=True)[1])
    conditions, order = seen[0], np.argsort(seen[0].row)
    rows = order[first.covariates["push_index"].astype(int)]
    for name, error in (("elapsed_time", 0.6), ("dwell_time", 0.1), ("slider_x", 3e-4), ("slider_heading", 3e-3)):
        assert conditions.values[name][rows] == pytest.approx(first.covariates[name], abs=error), name
    away = wrap_angle(conditions.values["push_heading"][rows] - first.covariates["push_heading"])
    assert away == pytest.approx(0.0, abs=0.02)
    assert np.corrcoef(conditions.values["slid_distance"][rows], first.covariates["slid_distance"])[0, 1] > 0.99
    assert conditions.values["room/light"][rows] == pytest.approx(0.5 * conditions.values["elapsed_time"][rows])


def _found(recording: Recording) -> PushTable:
    assert recording.rig is not None
    return windows_to_table(find_windows(recording, recording.rig))


def test_recorded_topic_does_not_change_the_pushes() -> None:
    topic = Topic(np.array([0.0, 60.0]), np.array([5.0, 65.0]))
    with_topic = simulate(replace(ON_ABS, topics={"room/light": topic}))
    assert set(with_topic.scalars) == {"surface/temperature", "room/light"}
    stream = with_topic.scalars["room/light"]
    assert stream.value == pytest.approx(5.0 + (stream.stamp - stream.stamp[0]) / 1e9, abs=0.01)
    assert_same_streams(with_topic, recording_of(ON_ABS))


def test_pauses_delay_the_pushes() -> None:
    plain = recording_of(WITHOUT_NOISE).pusher.stamp
    paused = simulate(replace(WITHOUT_NOISE, pauses=np.array([0.0, 4.0, 1.0]))).pusher.stamp
    assert (paused[-1] - paused[0]) / 1e9 == pytest.approx((plain[-1] - plain[0]) / 1e9 + 5.0, abs=0.05)


def test_clock_offset_delays_only_the_tracker() -> None:
    plain, late = _both(Faults(clock_offset=0.02))
    moved = np.interp(late.slider.stamp - 20_000_000, plain.slider.stamp, plain.slider.x)
    inside = slice(10, -10)
    assert np.max(np.abs(late.slider.x - moved)[inside]) < 1e-3
    assert np.array_equal(late.pusher.x, plain.pusher.x)


def test_tracker_frame_error_moves_only_the_slider() -> None:
    plain, moved = _both(Faults(frame_rotation=0.1, frame_shift=(0.01, -0.02)))
    expected = rotate(np.column_stack([plain.slider.x, plain.slider.y]), np.array(0.1)) + [0.01, -0.02]
    assert np.column_stack([moved.slider.x, moved.slider.y]) == pytest.approx(expected, abs=1e-5)
    assert np.array_equal(moved.pusher.x, plain.pusher.x)


def test_tool_offset_and_wrench_bias_affect_only_their_streams() -> None:
    plain, faulty = _both(Faults(tool_offset=(0.002, 0.001), wrench_bias=(0.3, 0.0, 0.01)))
    assert faulty.pusher.x - plain.pusher.x == pytest.approx(0.002, abs=1e-5)
    assert faulty.pusher.y - plain.pusher.y == pytest.approx(0.001, abs=1e-5)
    assert plain.wrench is not None and faulty.wrench is not None
    assert faulty.wrench.fx - plain.wrench.fx == pytest.approx(0.3, abs=0.005)
    assert np.array_equal(faulty.slider.x, plain.slider.x)


def test_compliant_rod_bends_only_under_force() -> None:
    plain, bent = _both(Faults(compliance=5e-4))
    assert plain.wrench is not None
    away = np.hypot(bent.pusher.x - plain.pusher.x, bent.pusher.y - plain.pusher.y)
    force = np.interp(plain.pusher.stamp, plain.wrench.stamp, np.hypot(plain.wrench.fx, plain.wrench.fy))
    assert np.max(away[plain.pusher.z > 0.04]) < 2e-5
    assert np.median(away[force > 0.8]) == pytest.approx(5e-4 * np.median(force[force > 0.8]), rel=0.1)


def _both(faults: Faults) -> tuple[Recording, Recording]:
    return recording_of(WITHOUT_NOISE), sensed(WITHOUT_NOISE, faults=faults)
