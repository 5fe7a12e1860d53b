# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A simulated recording has the properties of a real one: separate stamps, noise, dropouts, resets, a lifted tip."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from coarse import coarse_simulator
from repository import BAGS
from sensed_motion import outcomes_of, sensed

from push_predictor.errors import RequestError, RigError
from push_predictor.geometry.frames import wrap_angle
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import PoseStream, Recording
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table
from push_predictor.simulation import dynamics
from push_predictor.simulation.dynamics import TRAVEL_STEP
from push_predictor.simulation.pushes import PushPlan, grid_pushes, random_pushes
from push_predictor.simulation.rig_simulator import Sensors, SimulationSpec, push_outcomes, simulate
from push_predictor.simulation.standard_bags import standard_bags
from push_predictor.types import Array

LIFTED = 0.03  # m


def spec_of(seed: int = 1, pushes: int = 8, travel: float = 0.008, **options: object) -> SimulationSpec:
    plan = random_pushes(pushes, [0.02, 0.05], travel, np.random.default_rng(seed), angle_limit=0.8)
    return SimulationSpec("rect1", "abs", plan, seed=seed, **options)


@pytest.fixture(scope="module", autouse=True)
def coarsely() -> Iterator[None]:
    """But for the committed bags: sensors see the coarse motion as they see the fine one."""
    with coarse_simulator(3.0):
        yield


@pytest.fixture(scope="module")
def simulated(coarsely: None) -> Recording:
    return simulate(spec_of())


def seconds(stream: PoseStream) -> Array:
    return np.asarray((stream.stamp - stream.stamp[0]) / 1e9)


def lifted_at(recording: Recording, stamp: Array) -> Array:
    return np.interp(stamp, recording.pusher.stamp, recording.pusher.z) > LIFTED


def test_stamps_increase_and_the_clocks_differ(simulated: Recording) -> None:
    assert simulated.wrench is not None
    streams = (simulated.slider.stamp, simulated.pusher.stamp, simulated.wrench.stamp)
    for stamp in streams:
        assert np.all(np.diff(stamp) > 0)
        assert np.median(np.diff(stamp)) == pytest.approx(1e7, rel=0.02)
        assert np.std(np.diff(stamp)) > 1e5
    assert len(np.intersect1d(streams[0], streams[1])) < 0.2 * len(streams[0])


@pytest.mark.slow
def test_recordings_of_different_specs_share_no_stamps(simulated: Recording) -> None:
    others = (simulate(spec_of(*short, 0.002)) for short in ((2, 2), (3, 2), (2, 3)))
    spans = sorted((r.slider.stamp[0], r.slider.stamp[-1]) for r in (simulated, *others))
    assert all(before[1] < after[0] for before, after in pairwise(spans))


def test_tracker_noise_has_the_specified_standard_deviation() -> None:
    quiet = Sensors(dropout_interval=0.0)
    stream = simulate(spec_of(pushes=6, travel=0.004, sensors=quiet)).slider
    resting = np.abs(np.diff(stream.x, 2)) < 3e-4  # second differences: sd is sqrt(6) times that of a sample
    assert np.std(np.diff(stream.x, 2)[resting]) / np.sqrt(6.0) == pytest.approx(quiet.tracker_noise, rel=0.3)


@pytest.mark.slow
def test_dropouts_occur_at_the_specified_rate() -> None:
    spec = spec_of(travel=0.004)
    none, some = (sensed(spec, sensors=Sensors(dropout_interval=interval)).slider for interval in (0.0, 0.5))
    assert np.all(np.diff(none.stamp) < 25_000_000)
    assert np.sum(np.diff(some.stamp) > 25_000_000) == pytest.approx(seconds(some)[-1] / 0.5, rel=0.4)


def test_force_is_zero_while_the_tip_is_lifted(simulated: Recording) -> None:
    wrench = simulated.wrench
    assert wrench is not None
    lifted = lifted_at(simulated, wrench.stamp)
    assert np.std(wrench.fx[lifted]) == pytest.approx(Sensors().force_noise, rel=0.2)
    assert np.max(np.abs(wrench.fx[lifted])) < 0.2 < np.percentile(np.hypot(wrench.fx, wrench.fy), 90)


def test_rig_record_equals_the_simulated_rig(simulated: Recording) -> None:
    rig = simulated.rig
    assert rig is not None
    assert (rig.shape, rig.surface, rig.object_mass) == ("rect1", "abs", 0.837)
    assert rig.support_points is not None
    assert np.sum(rig.support_points[:, 2]) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shape", "surface"), [("rect1", "abs"), pytest.param("ellip2", "plywood", marks=pytest.mark.long)]
)
def test_windows_of_the_streams_agree_with_the_true_motion(shape: str, surface: str) -> None:
    plan = random_pushes(15, [0.02, 0.05], 0.025, np.random.default_rng(11), angle_limit=0.9)
    spec = SimulationSpec(shape, surface, plan, seed=5, sensors=Sensors(dropout_interval=0.0))
    recording = sensed(spec)
    assert recording.rig is not None
    found, true = windows_to_table(find_windows(recording, recording.rig)), outcomes_of(spec)
    assert abs(len(found.pushes) - len(true.pushes)) <= 1
    assert len(found) == pytest.approx(len(true), rel=0.1)
    assert np.std(found.outcomes, axis=0) == pytest.approx(np.std(true.outcomes, axis=0), rel=0.1)
    assert np.mean(found.inputs[:, 0]) == pytest.approx(np.mean(true.inputs[:, 0]), rel=0.05)


def test_recorded_pushes_follow_the_plan() -> None:
    plan = PushPlan(np.array([0.1, 0.6]), np.array([0.4, -0.7]), np.array([0.02, 0.05]), np.full(2, 0.012))
    spec = SimulationSpec("ellip2", "delrin", plan, seed=1)
    first, longer = (
        table.take(np.unique(table.push_id, return_index=True)[1])
        for table in (push_outcomes(spec, duration) for duration in (0.2, 0.2032))  # the other ends between two steps
    )
    assert first.inputs[:, 0] == pytest.approx(plan.speed)
    assert first.inputs[:, 1] == pytest.approx(plan.contact, abs=0.002)
    assert first.inputs[:, 2] == pytest.approx(plan.angle, abs=0.01)
    assert longer.outcomes[:, 0] / 0.2032 == pytest.approx(first.outcomes[:, 0] / 0.2, rel=2e-3)


def test_invalid_plan_or_rig_is_rejected_by_name() -> None:
    with pytest.raises(RequestError, match=r"angle: 1\.6"):
        grid_pushes([0.1], [1.6], 2)
    with pytest.raises(RequestError, match=r"speed: -0\.02"):
        random_pushes(3, [-0.02])
    with pytest.raises(RequestError, match="pushes: 0"):
        random_pushes(0, [0.02])
    with pytest.raises(RigError, match="surface: 'ice'"):
        simulate(SimulationSpec("rect1", "ice", random_pushes(1, [0.02])))
    with pytest.raises(RigError, match="shape: 'star'"):
        simulate(SimulationSpec("star", "abs", random_pushes(1, [0.02])))


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param("circle_pu", marks=pytest.mark.long), "hexagon_delrin"])
def test_committed_bags_equal_the_output_of_their_command(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dynamics, "TRAVEL_STEP", TRAVEL_STEP)
    kept, made = read_recording(BAGS / name), simulate(standard_bags()[name])
    assert np.array_equal(kept.slider.stamp, made.slider.stamp)
    assert np.array_equal(kept.pusher.stamp, made.pusher.stamp)
    assert np.median(np.abs(kept.slider.x - made.slider.x)) < 1e-12
    assert np.median(np.abs(wrap_angle(kept.slider.heading - made.slider.heading))) < 1e-12
    assert kept.wrench is not None and made.wrench is not None
    assert np.median(np.abs(kept.wrench.fx - made.wrench.fx)) < 1e-12
    assert np.max(np.abs(kept.slider.x - made.slider.x)) < 1e-4


def test_all_committed_bags_exist_and_are_small() -> None:
    names = set(standard_bags())
    assert {path.parent.name for path in BAGS.glob("*/metadata.yaml")} >= names
    assert sum(path.stat().st_size for name in names for path in (BAGS / name).iterdir()) < 8e6
