# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0
"""A live wrench is turned, moved to the tip and freed of its bias as reading a recording of it does."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
from lab_bags import Lab, Message, short_recording
from turning_sensor import add_tip, add_wrench, measured_at_mount, sensor_tf, tip_rows

from push_predictor.online.sensors import live_bias
from push_predictor.online.sensors.live_wrench import LiveWrench
from push_predictor.online.sensors.transform_buffer import TransformBuffer
from push_predictor.recordings.bag.cdr import POSE_STAMPED, WRENCH_STAMPED, decode
from push_predictor.recordings.fields.pose_rows import normalised
from push_predictor.recordings.fields.wrench_axes import in_sensor_axes
from push_predictor.recordings.fields.wrench_bias import gravity_direction
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import Recording, WrenchStream
from push_predictor.recordings.topics import Topics
from push_predictor.types import Array, IntArray

SLIDER, TIP, SENSOR = "/slider", "/tip", "/ft"
NAMES = Topics(SLIDER, TIP, SENSOR)
BASE = normalised(np.array([[0.4, -0.1, 0.2, 0.1, -0.2, 0.3, 0.9]]))
BIAS, WEIGHT, LEVER = np.array([0.5, -0.3, 1.2, 0.02, 0.01, -0.03]), 3.0, np.array([0.1, -0.05, 0.2])
SECOND = 10**9


@cache
def original() -> Recording:
    return short_recording()


def wrench() -> WrenchStream:
    found = original().wrench
    assert found is not None
    return found


def lab(values: Array, frame: str, tf: bool = False, world: str = "world", lifts: bool = True) -> Lab:
    """Slider, a tip that turns about a tilted axis, and a sensor with values (n, 6); tf: also frames to the sensor."""
    made = Lab()
    made.pose(SLIDER, "geometry_msgs/msg/PoseStamped", original().slider, "pose")
    pusher = original().pusher if lifts else replace(original().pusher, z=np.full(len(original().pusher), 0.01))
    add_tip(made, TIP, pusher.stamp, tip_rows(pusher, pusher.stamp))
    add_wrench(made, SENSOR, wrench().stamp, values, frame)
    if tf:
        sensor_tf(made, original().pusher, BASE, world)
    return made


@cache
def turned() -> Lab:
    """The sensor turns with the robot's mount, whose frames are in tf."""
    return lab(measured_at_mount(wrench(), original().pusher), "ft", True)


@cache
def still(lifts: bool = True) -> list[Message]:
    """The messages of a sensor along the world's axes, with a bias."""
    return lab(biased("world"), "world", lifts=lifts).in_order()


def live(
    messages: list[Message], topics: Topics, portion: int, world: str = "world"
) -> tuple[WrenchStream, LiveWrench, list[int]]:
    """The wrench as it is known after each portion of messages; the number of wrenches after each."""
    frame = topics.wrench_tf_frame
    buffer = TransformBuffer([], world, frame) if frame else None
    found, parts = LiveWrench(topics, buffer), []
    rig = original().rig
    assert rig is not None
    found.begin(rig)
    for first in range(0, len(messages), portion):
        now = messages[first : first + portion]
        for _, topic, data in now:
            if buffer is not None and topic.startswith("/tf"):
                buffer.put(data, topic == "/tf_static")
        parts.append(found.put(*(taken(now, topic) for topic in (SENSOR, SLIDER, TIP))))
    counts = [len(part) for part in parts]
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in ("stamp", "fx", "fy", "torque")}
    return WrenchStream(**joined), found, counts


def taken(messages: list[Message], topic: str) -> tuple[IntArray, Array]:
    columns = decode(
        [data for _, name, data in messages if name == topic], WRENCH_STAMPED if topic == SENSOR else POSE_STAMPED
    )
    return columns.stamp, columns.values


def assert_same(found: WrenchStream, wanted: WrenchStream | None, atol: float = 1e-9) -> None:
    """found is what reading gives, but for samples that still wait at the end."""
    assert wanted is not None and len(wanted) > 100 and 0 <= len(wanted) - len(found) < 8
    kept = slice(0, len(found))
    assert np.array_equal(found.stamp, wanted.stamp[kept])
    for name in ("fx", "fy", "torque"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name)[kept], atol=atol)


@pytest.mark.parametrize(("portion", "world"), [(29, "world"), (400, "map"), (100_000, "world")])
def test_a_sensor_at_a_frame_of_tf_gives_the_wrench_of_the_recording(tmp_path: Path, portion: int, world: str) -> None:
    made, topics = (
        lab(measured_at_mount(wrench(), original().pusher), "ft", True, world),
        replace(NAMES, wrench_frame="ft"),
    )
    found, state, _ = live(made.in_order(), topics, portion)
    assert_same(found, read_recording(made.mcap(tmp_path / "lab"), topics=topics).wrench)
    assert not state.problems and "wrench without pose" not in state.figures()


def test_a_sensor_whose_transforms_are_ahead_of_the_tip_waits_for_it(tmp_path: Path) -> None:
    topics = replace(NAMES, wrench_frame="ft")
    made = turned()
    messages = made.in_order()
    tips = [message for message in messages if message[1] == TIP]
    first = [message for message in messages if message[1] != TIP] + tips[: len(tips) // 2]
    found, _, counts = live([*first, *tips[len(tips) // 2 :]], topics, len(first))
    assert counts[0] > 50 and counts[1] > 50
    assert_same(found, read_recording(made.mcap(tmp_path / "lab"), topics=topics).wrench)


def test_a_frame_that_tf_does_not_have_is_named_and_its_wrenches_wait() -> None:
    messages = turned().in_order()
    buffer = TransformBuffer([], "world", "other")
    found = LiveWrench(replace(NAMES, wrench_frame="other"), buffer)
    assert len(found.put(taken(messages, SENSOR), taken(messages, SLIDER), taken(messages, TIP))) == 0
    assert buffer.turned_problem == "no frame 'other'; the frames are none"
    for _, topic, data in messages:
        if topic.startswith("/tf"):
            buffer.put(data, topic == "/tf_static")
    nothing = taken([], SENSOR), taken([], SLIDER), taken([], TIP)
    found.put(*nothing)
    assert buffer.turned_problem == "no frame 'other'; the frames are base, ft, tool0, world"


def test_transforms_of_a_sensor_are_forgotten_when_no_wrench_needs_them() -> None:
    buffer, made, stamps = TransformBuffer([], "world", "ft"), Lab(), np.arange(0, 60 * SECOND, SECOND // 100)
    rows = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(stamps), 1))
    made.transform("/tf", "world", "ft", stamps, rows)
    for number, (_, _, data) in enumerate(made.in_order()):
        buffer.put(data, False)
        if number % 500 == 499:
            at = stamps[max(number - 600, 0) : number + 3 : 50]
            decided, poses = buffer.at(at)
            assert decided.tolist() == (at <= stamps[number]).tolist() and not np.isnan(poses).any()
    assert 500 <= len(buffer._histories["ft"].edge.stamp) < 1700


def biased(frame: str) -> Array:
    """What a sensor at the tip measures (n, 6): without contact its bias and, where it turns with the tip, weight."""
    none = np.zeros(len(wrench()))
    true = np.column_stack([wrench().fx, wrench().fy, none, none, none, wrench().torque])
    if frame == "world":
        return np.asarray(true + BIAS)
    poses = tip_rows(original().pusher, wrench().stamp)
    down = gravity_direction(poses)
    return np.asarray(in_sensor_axes(true, poses) + BIAS + np.hstack([WEIGHT * down, np.cross(LEVER, down)]))


@pytest.mark.parametrize("frame", ["world", "tip"])
def test_the_bias_is_estimated_as_from_a_recording_and_subtracted(tmp_path: Path, frame: str) -> None:
    topics = replace(NAMES, wrench_frame=frame, wrench_bias="free_motion")
    made = lab(biased(frame), "world" if frame == "world" else "ft")
    found, state, counts = live(made.in_order(), topics, 50)
    read = read_recording(made.mcap(tmp_path / "lab", original().rig), topics=topics)
    assert_same(found, read.wrench, atol=0.1)
    raw = read_recording(tmp_path / "lab", topics=replace(topics, wrench_bias="none")).wrench
    assert raw is not None and np.abs(raw.fx[: len(found)] - found.fx).max() > 0.4
    first = int(np.flatnonzero(counts)[0])
    assert first > 5 and counts[first] > 100, "held back, then all at once"
    bias, text = state._bias, str(state.figures()["wrench bias"])  # type: ignore[attr-defined]
    assert text.startswith("the bias (") and "s of free motion" in text and not state.problems
    assert bias.estimate.force[:2] == pytest.approx(read.wrench_bias.force[:2], abs=0.06)  # type: ignore[union-attr]


def test_with_all_samples_at_once_the_estimate_is_that_of_the_recording(tmp_path: Path) -> None:
    topics = replace(NAMES, wrench_frame="tip", wrench_bias="free_motion")
    made = lab(biased("tip"), "ft")
    found, _, _ = live(made.in_order(), topics, 10**6)
    assert_same(found, read_recording(made.mcap(tmp_path / "lab", original().rig), topics=topics).wrench)


def test_without_free_motion_the_wrench_is_held_back_and_it_is_said() -> None:
    topics, messages = replace(NAMES, wrench_bias="free_motion"), still(lifts=False)
    rig = original().rig
    assert rig is not None
    held = LiveWrench(topics)
    portion = [taken(messages, topic) for topic in (SENSOR, SLIDER, TIP)]
    assert len(held.put(*portion)) == 0 and held.waits_for_bias, "no rig yet"
    held.begin(replace(rig, pusher_radius=5.0))
    assert not held.waits_for_bias and len(held.put(*portion)) == 0 and held.waits_for_bias
    assert held.problems and "contact is found from geometry alone. Lift the tip" in held.problems[0]
    assert "not known yet: the tip is free for" in str(held.figures()["wrench bias"])
    held.begin(rig)
    lifted = still()
    assert len(held.put(*(taken(lifted, topic) for topic in (SENSOR, SLIDER, TIP)))) == len(wrench())
    assert not held.problems and not held.waits_for_bias


def test_samples_of_two_times_are_not_one_free_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    topics, messages = replace(NAMES, wrench_bias="free_motion"), still()
    held, rig = LiveWrench(topics), original().rig
    assert rig is not None
    part = [taken(messages[: len(messages) // 2], topic) for topic in (SENSOR, SLIDER, TIP)]
    monkeypatch.setattr(live_bias, "FIRST", len(part[0][0]) + 1)
    held.begin(rig)
    assert len(held.put(*part)) == len(held.put(*part)) == 0, "the clock was set back: half of them were forgotten"
    monkeypatch.setattr(live_bias, "FIRST", 50)
    held.begin(rig)
    everything = [taken(messages, topic) for topic in (SENSOR, SLIDER, TIP)]
    first = held.put(*everything)
    estimate = held.figures()["wrench bias"]
    again = held.put(*part)
    assert np.array_equal(again.fx, first.fx[: len(again)]) and held.figures()["wrench bias"] == estimate


def test_few_samples_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live_bias, "MOST", 200)
    topics, messages = replace(NAMES, wrench_bias="free_motion"), still()
    rig = original().rig
    assert rig is not None
    for given in (replace(rig, pusher_radius=5.0), rig):  # the bias stays unknown as long as possible, and not
        held = LiveWrench(topics)
        held.begin(given)
        for first in range(0, len(messages), 40):
            now = messages[first : first + 40]
            held.put(*(taken(now, topic) for topic in (SENSOR, SLIDER, TIP)))
            assert held._bias is not None and held._bias._count <= 240
