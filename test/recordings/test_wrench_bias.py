# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Bias and weight of a force sensor, estimated from free motion and subtracted."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
from lab_bags import Lab
from test_lab_topics import assert_same_windows, original, wrench
from turning_sensor import add_tip, add_wrench, in_sensor_axes, tip_rows

from push_predictor.cli import main
from push_predictor.errors import RecordingError
from push_predictor.geometry.frames import to_body
from push_predictor.recordings.fields.wrench_bias import BiasError, estimate_bias, gravity_direction
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.topics import Topics, load_topics
from push_predictor.recordings.windows.clock_session import free_motion

BIAS = np.array([0.5, -0.3, 1.2, 0.02, 0.01, -0.03])
WEIGHT, LEVER = 3.0, np.array([0.1, -0.05, 0.2])
NAMES = Topics("/slider", "/tip", "/ft", wrench_frame="tip", wrench_bias="free_motion")
MILLISECOND = 1_000_000


def weighed(poses: np.ndarray) -> np.ndarray:
    """What the sensor adds to the wrench at poses (n, 7)."""
    down = gravity_direction(poses)
    return np.asarray(BIAS + np.hstack([WEIGHT * down, np.cross(LEVER, down)]))


# --- pure functions ---------------------------------------------------------------------------------------------------


def tilted(angle: np.ndarray) -> np.ndarray:
    """Poses (n, 7) turned about the y axis."""
    none = np.zeros(len(angle))
    return np.column_stack([none, none, none, none, np.sin(angle / 2), none, np.cos(angle / 2)])


def sampled(n: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Stamps at 10 ms, free for 0.5 s of every second, and poses that tilt back and forth."""
    stamp = 1_700_000_000_000_000_000 + 10 * MILLISECOND * np.arange(n)
    return stamp, np.arange(n) % 100 < 50, tilted(0.6 * np.sin(0.02 * np.arange(n)))


def test_gravity_points_down_along_the_axes_of_a_tilted_sensor() -> None:
    # Turned by 30 degrees about y, the sensor's x axis points downwards by half.
    np.testing.assert_allclose(gravity_direction(tilted(np.array([np.pi / 6]))), [[0.5, 0.0, -np.sqrt(0.75)]])


def test_bias_and_weight_of_a_sensor_that_tilts_are_recovered() -> None:
    stamp, free, poses = sampled()
    wrenches = weighed(poses)
    wrenches[~free] += 7.0  # contact
    bias = estimate_bias(stamp, wrenches, free, poses)
    np.testing.assert_allclose(np.concatenate([bias.force, bias.torque]), BIAS, atol=1e-9)
    assert bias.weight == pytest.approx(WEIGHT, abs=1e-9) and bias.lever is not None
    np.testing.assert_allclose(bias.lever, LEVER, atol=1e-9)
    assert (bias.seconds, bias.intervals) == (pytest.approx(2.0), 8)
    contact = np.where(free, 0.0, 7.0)[:, None] * np.ones(6)
    np.testing.assert_allclose(bias.subtracted_from(wrenches, poses), contact, atol=1e-9)


def test_the_weight_of_a_sensor_that_does_not_tilt_is_part_of_the_bias() -> None:
    stamp, free, _ = sampled()
    level = tilted(np.full(len(stamp), 0.4))
    bias = estimate_bias(stamp, weighed(level), free, level)
    assert bias.weight is None and bias.lever is None and "weight" not in bias.to_text()
    np.testing.assert_allclose(bias.force, weighed(level)[0, :3])
    np.testing.assert_allclose(bias.subtracted_from(weighed(level), level), 0.0, atol=1e-12)


def test_the_standard_deviations_are_those_of_repeated_estimates() -> None:
    stamp, free, poses = sampled()
    noise = np.array([0.02, 0.05, 0.1, 0.003, 0.002, 0.001])
    found = [
        estimate_bias(stamp, weighed(poses) + noise * np.random.default_rng(seed).normal(size=(400, 6)), free, poses)
        for seed in range(200)
    ]
    for name in ("force", "torque", "weight"):
        values, sds = (np.array([getattr(bias, key) for bias in found]) for key in (name, f"{name}_sd"))
        np.testing.assert_allclose(values.std(axis=0) / np.sqrt(np.mean(sds**2, axis=0)), 1.0, atol=0.25)
    assert np.mean([bias.weight for bias in found]) == pytest.approx(WEIGHT, abs=0.02)


def test_a_noisy_vertical_axis_spoils_neither_the_others_nor_the_estimate() -> None:
    stamp, free, _ = sampled()
    noise = np.array([0.001, 0.001, 5.0, 0.0, 0.0, 0.0]) * np.random.default_rng(0).normal(size=(400, 6))
    level, sideways = tilted(np.zeros(400)), tilted(np.full(400, np.pi / 2))
    for poses in (None, level):
        bias = estimate_bias(stamp, BIAS + noise, free, poses)
        assert bias.force_sd[2] > 100 * bias.force_sd[0]
    with pytest.raises(BiasError, match=r"known to 0.* N"):  # this axis of the sensor lies in the plane
        estimate_bias(stamp, BIAS + noise, free, sideways)


def test_too_little_free_motion_is_refused() -> None:
    stamp, _, poses = sampled()
    brief = np.arange(400) % 100 < 20  # 0.8 s
    with pytest.raises(BiasError, match=r"the tip is free for 0\.8 s, at least 1 s is needed; lift the tip between p"):
        estimate_bias(stamp, weighed(poses), brief, poses)
    with pytest.raises(BiasError, match="free for 0 s"):
        estimate_bias(stamp, weighed(poses), np.zeros(400, dtype=np.bool_), poses)


def test_free_motion_in_one_orientation_does_not_determine_the_force_in_another() -> None:
    stamp, free, _ = sampled()
    poses = tilted(np.where(free, 0.0, 0.5))
    with pytest.raises(BiasError, match=r"at most 0\.1 N is accepted; record free motion in the orientations of the p"):
        estimate_bias(stamp, weighed(poses), free, poses)


def test_one_pose_that_jumps_changes_nothing() -> None:
    stamp, free, _ = sampled()
    angle = np.zeros(400)
    angle[130] = 1.0
    assert estimate_bias(stamp, weighed(tilted(np.zeros(400))), free, tilted(angle)).weight is None


# --- free motion ------------------------------------------------------------------------------------------------------


@cache
def free() -> np.ndarray:
    recording = original()
    assert recording.rig is not None
    return free_motion(recording.rig, recording.slider, recording.pusher, wrench().stamp)


def test_free_samples_are_lifted_or_away_from_the_outline() -> None:
    slider, pusher, rig, stamp = original().slider, original().pusher, original().rig, wrench().stamp
    assert rig is not None and 50 < np.sum(free()) < 200
    start = stamp[0]

    def at(stream: object, name: str) -> np.ndarray:
        return np.interp(stamp - start, stream.stamp - start, getattr(stream, name))  # type: ignore[attr-defined]

    pose = np.column_stack([at(slider, name) for name in ("x", "y", "heading")])
    tip = np.column_stack([at(pusher, "x"), at(pusher, "y")])
    gap = rig.outline.project(to_body(tip, pose)).distance - rig.pusher_radius
    away = (gap > 0.005) | (at(pusher, "z") - at(slider, "z") > 0.02)
    assert np.mean(free() == away) > 0.97 and not (free() & (gap < 0.003) & ~away).any()


def test_samples_in_a_dropout_or_after_the_clock_was_set_are_not_free() -> None:
    recording, slider = original(), original().slider
    assert recording.rig is not None
    place = int(np.flatnonzero(free())[40])
    stamp = wrench().stamp
    kept = np.abs(slider.stamp - stamp[place]) > 60 * MILLISECOND
    cut = replace(slider, **{name: value[kept] for name, value in vars(slider).items()})
    found = free_motion(recording.rig, cut, recording.pusher, stamp)
    assert free()[place] and not found[place]
    assert (found | (np.abs(stamp - stamp[place]) < 120 * MILLISECOND))[free()].all()
    twice = free_motion(recording.rig, slider, recording.pusher, np.concatenate([stamp, stamp]))
    assert (twice[: len(stamp)] == free()).all() and np.sum(twice[len(stamp) :]) < 0.2 * np.sum(free())


# --- recordings -------------------------------------------------------------------------------------------------------


@cache
def unbiased() -> np.ndarray:
    """The recorded wrench (n, 6) along the world's axes, whose own mean in free motion is removed."""
    none = np.zeros(len(wrench()))
    rows = np.column_stack([wrench().fx, wrench().fy, none, none, none, wrench().torque])
    return np.asarray(rows - rows[free()].mean(axis=0))


def lab_with_bias(frames: bool = True, lifts: bool = True) -> Lab:
    """A sensor at a tip that turns about a tilted axis, or one that reports along the world's axes."""
    lab, pusher = Lab(), original().pusher
    pusher = pusher if lifts else replace(pusher, z=np.full(len(pusher), 0.01))
    lab.pose("/slider", "geometry_msgs/msg/PoseStamped", original().slider, "pose")
    add_tip(lab, "/tip", pusher.stamp, tip_rows(pusher, pusher.stamp))
    poses = tip_rows(pusher, wrench().stamp)
    values = in_sensor_axes(unbiased(), poses) + weighed(poses) if frames else unbiased() + BIAS
    add_wrench(lab, "/ft", wrench().stamp, values, "ft" if frames else "world")
    return lab


def assert_unbiased(found: Recording, atol: float) -> None:
    assert found.wrench is not None
    read = np.column_stack([found.wrench.fx, found.wrench.fy, found.wrench.torque])
    np.testing.assert_allclose(read[:, :2], unbiased()[:, :2], rtol=0.0, atol=atol)
    np.testing.assert_allclose(read[:, 2], unbiased()[:, 5], rtol=0.0, atol=0.02 * atol + 1e-4)


def test_a_turning_sensor_with_bias_and_weight_gives_the_windows_of_the_original(tmp_path: Path) -> None:
    path = lab_with_bias().mcap(tmp_path / "lab", original().rig)
    found = read_recording(path, topics=NAMES)
    assert_unbiased(found, atol=0.02)
    assert_same_windows(found)
    bias = found.wrench_bias
    assert bias is not None and bias.weight == pytest.approx(WEIGHT, abs=0.02)
    np.testing.assert_allclose(bias.force, BIAS[:3], atol=0.02)
    assert any("subtracted the bias (0.5" in note and "s of free motion in" in note for note in found.notes)
    raw = read_recording(path, topics=replace(NAMES, wrench_bias=""))
    assert raw.wrench is not None and np.hypot(raw.wrench.fx, raw.wrench.fy)[free()].max() > 0.5


def test_a_planar_sensor_without_the_other_numbers_has_its_bias_subtracted(tmp_path: Path) -> None:
    lab = Lab()
    lab.pose("/slider", "geometry_msgs/msg/PoseStamped", original().slider, "pose")
    lab.pose("/tip", "geometry_msgs/msg/PoseStamped", original().pusher, "pose")
    values = unbiased() + BIAS
    values[:, 2:5] = np.nan
    add_wrench(lab, "/ft", wrench().stamp, values, "world")
    path = lab.mcap(tmp_path / "lab", original().rig)
    assert_unbiased(read_recording(path, topics=replace(NAMES, wrench_frame="")), atol=0.005)


def test_without_a_rig_the_bias_stays_and_a_note_says_so(tmp_path: Path) -> None:
    found = read_recording(lab_with_bias().mcap(tmp_path / "lab"), topics=NAMES)
    assert found.wrench_bias is None
    assert any(
        "the bias of the wrench is not subtracted: free motion is found with a rig" in note for note in found.notes
    )
    given = read_recording(tmp_path / "lab", topics=NAMES, rig=original().rig)
    assert_unbiased(given, atol=0.02)


def test_a_recording_without_free_motion_is_refused_by_name(tmp_path: Path) -> None:
    path = lab_with_bias(lifts=False).mcap(tmp_path / "lab", original().rig)
    assert original().rig is not None
    thick = replace(original().rig, pusher_radius=5.0)  # always in contact
    with pytest.raises(
        RecordingError, match=r"wrench_bias 'free_motion' \(option --wrench-bias\): the tip is free for"
    ):
        read_recording(path, topics=NAMES, rig=thick)


def test_the_estimate_is_in_the_description(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(lab_with_bias().mcap(tmp_path / "lab", original().rig))
    names = ["--slider-topic", "/slider", "--pusher-topic", "/tip", "--wrench-topic", "/ft", "--wrench-frame", "tip"]
    assert main(["info", path, *names, "--wrench-bias", "free_motion", "--save-topics"]) == 0
    shown = capsys.readouterr().out
    assert "force_sd:" in shown and "weight: 2.99" in shown and " N\n" in shown and "free motion in" in shown
    assert load_topics(tmp_path / "lab") == NAMES
    assert main(["info", path, "--json", "-"]) == 0
    described = json.loads(capsys.readouterr().out)["wrench_bias"]
    assert described["force"] == pytest.approx(BIAS[:3], abs=0.02)
    assert 0.0 < described["weight_sd"] < 0.02 and described["axes"] == "of the sensor"
    assert main(["info", path, "--wrench-bias", "none", "--json", "-"]) == 0
    assert "wrench_bias" not in json.loads(capsys.readouterr().out)
