# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0
"""A wrench in portions is turned, moved to the tip and freed of its bias as reading a recording of it does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
from decoding import decoder_of, in_portions, joined_samples, put
from lab_bags import Lab, Message, short_recording
from turning_sensor import add_tip, add_wrench, in_sensor_axes, measured_at_mount, sensor_tf, tip_rows

from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.decoder import bias_so_far
from push_predictor.recordings.decoder.decoder import Samples, StreamDecoder
from push_predictor.recordings.decoder.transform_buffer import TransformBuffer
from push_predictor.recordings.fields.pose_rows import normalised
from push_predictor.recordings.fields.sources import TF_TYPES
from push_predictor.recordings.fields.wrench_bias import BiasError, gravity_direction
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import Recording, WrenchStream
from push_predictor.recordings.streams import taken as rows_of
from push_predictor.recordings.topics import Topics
from push_predictor.types import Array

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


def lab(values: Array, frame: str, tf: bool = False, lifts: bool = True) -> Lab:
    """Slider, a tip that turns about a tilted axis, and a sensor with values (n, 6); tf: also frames to the sensor."""
    made = Lab()
    made.pose(SLIDER, "geometry_msgs/msg/PoseStamped", original().slider, "pose")
    pusher = original().pusher if lifts else replace(original().pusher, z=np.full(len(original().pusher), 0.01))
    add_tip(made, TIP, pusher.stamp, tip_rows(pusher, pusher.stamp))
    add_wrench(made, SENSOR, wrench().stamp, values, frame)
    if tf:
        sensor_tf(made, original().pusher, BASE, "world")
    return made


@cache
def turned() -> Lab:
    """The sensor turns with the robot's mount, whose frames are in tf."""
    return lab(measured_at_mount(wrench(), original().pusher), "ft", True)


@cache
def still(lifts: bool = True) -> Lab:
    """A sensor along the world's axes, with a bias."""
    return lab(biased("world"), "world", lifts=lifts)


def live(made: Lab, topics: Topics, *portions: Sequence[Message]) -> tuple[WrenchStream, StreamDecoder, list[int]]:
    """The wrench as it is known after each portion of messages; the number of wrenches after each."""
    decoder, parts = decoder_of(made, topics, rig=original().rig), []
    for portion in portions:
        parts.append(taken(decoder, made, portion))
    return joined_samples(parts).wrench, decoder, [len(part.wrench) for part in parts]


def taken(decoder: StreamDecoder, made: Lab, portion: Sequence[Message] | None = None) -> Samples:
    """The samples that are known with a portion of messages, of all by default."""
    put(decoder, made, made.in_order() if portion is None else portion, live=True)
    return decoder.take()


def assert_same(found: WrenchStream, wanted: WrenchStream | None, atol: float = 1e-9) -> None:
    """found is what reading gives, but for samples that still wait at the end."""
    assert wanted is not None and len(wanted) > 100 and 0 <= len(wanted) - len(found) < 8
    kept = slice(0, len(found))
    assert np.array_equal(found.stamp, wanted.stamp[kept])
    for name in ("fx", "fy", "torque"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name)[kept], atol=atol)


def test_a_frame_that_tf_does_not_have_is_named_and_its_wrenches_wait() -> None:
    messages, transforms = ([m for m in turned().in_order() if m[1].startswith("/tf") is tf] for tf in (False, True))
    decoder = decoder_of(turned(), replace(NAMES, wrench_frame="other"))
    assert len(taken(decoder, turned(), messages).wrench) == 0
    assert decoder.wrench.problem == "no transform has been published"
    assert len(taken(decoder, turned(), transforms).wrench) == 0
    assert decoder.wrench.problem == "no frame 'other'; the frames are base, ft, tool0, world"


def test_transforms_of_a_sensor_are_forgotten_when_no_wrench_needs_them() -> None:
    buffer, made, stamps = TransformBuffer(), Lab(), np.arange(0, 25 * SECOND, SECOND // 100)
    rows = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(stamps), 1))
    made.transform("/tf", "world", "ft", stamps, rows)
    for number, (sent, topic, data) in enumerate(made.in_order()):
        buffer.put(Messages.of(topic, TF_TYPES[0], [sent], [data]), static=False)
        if number % 500 == 499:
            at = stamps[max(number - 600, 0) : number + 3 : 50]
            decided, poses = buffer.at("ft", "world", at, "wrench")
            buffer.forget()
            assert decided.tolist() == (at <= stamps[number]).tolist() and not np.isnan(poses).any()
    assert 500 <= len(buffer.histories["ft"].edge.stamp) < 1700


def biased(frame: str) -> Array:
    """What a sensor at the tip measures (n, 6): without contact its bias and, where it turns with the tip, weight."""
    none = np.zeros(len(wrench()))
    true = np.column_stack([wrench().fx, wrench().fy, none, none, none, wrench().torque])
    if frame == "world":
        return np.asarray(true + BIAS)
    poses = tip_rows(original().pusher, wrench().stamp)
    down = gravity_direction(poses)
    return np.asarray(in_sensor_axes(true, poses) + BIAS + np.hstack([WEIGHT * down, np.cross(LEVER, down)]))


def test_the_bias_is_estimated_as_from_a_recording_and_subtracted(tmp_path: Path) -> None:
    topics = replace(NAMES, wrench_frame="tip", wrench_bias="free_motion")
    made = lab(biased("tip"), "ft")
    found, state, counts = live(made, topics, *in_portions(made.in_order(), 50))
    read = read_recording(made.mcap(tmp_path / "lab", original().rig), topics=topics)
    assert_same(found, read.wrench, atol=0.1)
    raw = read_recording(tmp_path / "lab", topics=replace(topics, wrench_bias="none")).wrench
    assert raw is not None and np.abs(raw.fx[: len(found)] - found.fx).max() > 0.4
    first = int(np.flatnonzero(counts)[0])
    assert first > 5 and counts[first] > 100, "held back, then all at once"
    estimate, bias = state.wrench.estimate, state.wrench.bias
    assert estimate is not None and read.wrench_bias is not None and bias is not None and not bias.problem
    assert estimate.to_text().startswith("the bias (") and "s of free motion" in estimate.to_text()
    assert estimate.force[:2] == pytest.approx(read.wrench_bias.force[:2], abs=0.06)


def test_without_free_motion_the_wrench_is_held_back_and_it_is_said() -> None:
    topics, never = replace(NAMES, wrench_bias="free_motion"), still(lifts=False)
    rig = original().rig
    assert rig is not None
    decoder = decoder_of(never, topics)
    held = decoder.wrench
    assert len(taken(decoder, never).wrench) == 0 and held.waits_for_bias, "no rig yet"
    decoder.begin(replace(rig, pusher_radius=5.0))
    assert not held.waits_for_bias and len(taken(decoder, never).wrench) == 0 and held.waits_for_bias
    assert held.bias is not None and held.bias.problem.startswith("the tip is free for")
    decoder.begin(rig)
    assert len(taken(decoder, still()).wrench) == len(wrench())
    assert not held.bias.problem and not held.waits_for_bias


def test_samples_of_two_times_are_not_one_free_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    made, rig = still(), original().rig
    half = made.in_order()[: len(made.messages) // 2]
    count = sum(topic == SENSOR for _, topic, _ in half)
    decoder = decoder_of(made, replace(NAMES, wrench_bias="free_motion"), rig=rig)
    monkeypatch.setattr(bias_so_far, "FIRST", count + 1)
    assert rig is not None and decoder.wrench.bias is not None
    decoder.begin(rig)
    set_back = len(taken(decoder, made, half).wrench), len(taken(decoder, made, half).wrench)
    assert set_back == (0, 0), "the clock was set back: half of them were forgotten"
    monkeypatch.setattr(bias_so_far, "FIRST", 50)
    decoder.begin(rig)
    first = taken(decoder, made).wrench
    estimate = decoder.wrench.estimate
    again = taken(decoder, made, half).wrench
    assert np.array_equal(again.fx, first.fx[: len(again)]) and decoder.wrench.estimate is estimate


def test_few_samples_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bias_so_far, "MOST", 200)
    topics, rig = replace(NAMES, wrench_bias="free_motion"), original().rig
    assert rig is not None
    for given in (replace(rig, pusher_radius=5.0), rig):  # the bias stays unknown as long as possible, and not
        decoder = decoder_of(still(), topics, rig=given)
        for portion in in_portions(still().in_order(), 40):
            taken(decoder, still(), portion)
            assert decoder.wrench.bias is not None and decoder.wrench.bias._count <= 240


def test_a_bias_that_stays_unknown_is_not_sought_with_every_portion(monkeypatch: pytest.MonkeyPatch) -> None:
    attempts: list[int] = []

    def unknown(stamp: Array, *_: object) -> None:
        attempts.append(len(stamp))
        raise BiasError("no free motion")

    monkeypatch.setattr(bias_so_far, "MOST", 200)
    monkeypatch.setattr(bias_so_far, "estimate_bias", unknown)
    bias, rig, still_tip = bias_so_far.BiasSoFar(), original().rig, original().pusher
    assert rig is not None
    bias.begin(rig)
    for portion in range(200):
        stamp = SECOND + 1_000_000 * np.arange(5 * portion, 5 * portion + 5)
        pose = rows_of(original().slider, slice(0, 5)), rows_of(still_tip, slice(0, 5))
        bias.put(bias_so_far.Wrenches(stamp, np.zeros((5, 6))), *pose)
    assert bias.problem == "no free motion" and 40 <= len(attempts) <= 60
