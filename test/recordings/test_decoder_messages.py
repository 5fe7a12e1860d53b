# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Sensor messages become streams, or are rejected, by the rules of reading a recording."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from hypothesis import given
from hypothesis import strategies as st
from planar_messages import pose_message, wrench_message
from rclpy.serialization import serialize_message
from replay_bags import POSE, START, WRENCH, stamped, write_bag

from push_predictor.nodes.validator import sensor_subscriber
from push_predictor.online import message_buffer
from push_predictor.online.message_buffer import MessageBuffer
from push_predictor.recordings import samples
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.decoder.rules import PUSHER, SLIDER, pusher_stream, slider_stream, wrench_stream

GOOD = [0.1, -0.2, 0.03, 0.0, 0.0, math.sin(0.3), math.cos(0.3)]


def pose(*numbers: float, frame: str = "world", nanosec: int = 5) -> bytes:
    message = PoseStamped()
    message.header.frame_id, message.header.stamp.sec, message.header.stamp.nanosec = frame, 7, nanosec
    position, turn = message.pose.position, message.pose.orientation
    position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w = numbers
    return serialize_message(message)


def wrench(*numbers: float) -> bytes:
    message = WrenchStamped()
    message.header.frame_id = "world"
    force, torque = message.wrench.force, message.wrench.torque
    force.x, force.y, force.z, torque.x, torque.y, torque.z = numbers
    return serialize_message(message)


def filled(buffer: MessageBuffer, *messages: bytes) -> MessageBuffer:
    for message in messages:
        buffer.put(message)
    return buffer


def test_usable_messages_become_a_stream_in_order():
    buffer = filled(MessageBuffer(SLIDER, "world"), pose(*GOOD), pose(*GOOD, nanosec=9))
    stream = slider_stream(*buffer.take())
    assert stream.stamp.tolist() == [7_000_000_005, 7_000_000_009]
    assert (stream.x[0], stream.y[0], stream.z[0]) == (0.1, -0.2, 0.03)
    assert stream.heading == pytest.approx([0.6, 0.6])
    assert buffer.received == 2 and not buffer.rejected
    assert len(slider_stream(*buffer.take())) == 0


@given(st.integers(0, 2**31 * 10**9 - 1), st.floats(-10.0, 10.0), st.floats(-20.0, 20.0))
def test_a_quaternion_and_its_negative_are_the_same_heading(stamp: int, x: float, yaw: float):
    message = pose_message(stamp, x, -x, 0.5 * x, yaw)
    negated = pose_message(stamp, x, -x, 0.5 * x, yaw)
    negated.pose.orientation.z *= -1.0
    negated.pose.orientation.w *= -1.0
    buffer = filled(MessageBuffer(SLIDER, "world"), serialize_message(message), serialize_message(negated))
    stream = slider_stream(*buffer.take())
    assert stream.stamp.tolist() == [stamp, stamp]
    assert (stream.x[0], stream.y[0], stream.z[0]) == (x, -x, 0.5 * x)
    for heading in stream.heading:
        assert math.remainder(heading - yaw, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


@given(*[st.floats(-10.0, 10.0)] * 3)
def test_a_wrench_survives_its_message(fx: float, fy: float, torque: float):
    message = serialize_message(wrench_message(7, fx, fy, torque))
    stream = wrench_stream(*filled(MessageBuffer(samples.WRENCH, "world"), message).take())
    assert (stream.stamp[0], stream.fx[0], stream.fy[0], stream.torque[0]) == (7, fx, fy, torque)


@pytest.mark.parametrize(
    ("message", "kind"),
    [
        (pose(math.nan, *GOOD[1:]), "not finite"),
        (pose(*GOOD[:3], 0.0, 0.0, math.inf, 1.0), "not finite"),
        (pose(*GOOD[:3], 0.0, 0.0, 0.0, 0.0), "no orientation"),
        (pose(*GOOD, frame="map"), "frame_id"),
        (pose(*GOOD, frame=""), "frame_id"),
        (pose(*GOOD, nanosec=1_000_000_000), "unreadable"),
        (pose(*GOOD)[:40], "unreadable"),
    ],
    ids=["nan", "infinity", "zero quaternion", "other frame", "no frame", "bad stamp", "cut"],
)
def test_an_unusable_slider_pose_is_counted_by_kind_and_the_others_are_used(message: bytes, kind: str):
    buffer = filled(MessageBuffer(SLIDER, "world"), pose(*GOOD), message, pose(*GOOD))
    assert len(buffer.take()[0]) == 2
    assert dict(buffer.rejected) == {kind: 1}


def test_a_message_with_two_faults_is_counted_once():
    buffer = filled(MessageBuffer(SLIDER, "world"), pose(math.nan, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, frame="map"))
    buffer.take()
    assert buffer.rejected.total() == 1


def test_an_empty_frame_id_accepts_any_frame():
    assert len(filled(MessageBuffer(SLIDER, ""), pose(*GOOD, frame="map"), pose(*GOOD)).take()[0]) == 2


def test_the_orientation_of_the_tip_is_ignored():
    stream = pusher_stream(*filled(MessageBuffer(PUSHER, "world"), pose(*GOOD[:3], 0.0, 0.0, 0.0, 0.0)).take())
    assert stream.x.tolist() == [0.1]
    assert len(filled(MessageBuffer(PUSHER, "world"), pose(math.nan, *GOOD[1:])).take()[0]) == 0


def test_only_the_planar_part_of_a_wrench_must_be_finite():
    buffer = filled(
        MessageBuffer(samples.WRENCH, "world"),
        wrench(1.0, 2.0, math.nan, math.nan, math.nan, 3.0),
        wrench(math.nan, 0.0, 0.0, 0.0, 0.0, 0.0),
    )
    stream = wrench_stream(*buffer.take())
    assert (stream.fx.tolist(), stream.fy.tolist(), stream.torque.tolist()) == ([1.0], [2.0], [3.0])
    assert dict(buffer.rejected) == {"not finite": 1}


def test_a_full_buffer_drops_the_oldest_and_counts_them(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(message_buffer, "LIMIT", 100)
    buffer = MessageBuffer(SLIDER, "world")
    for k in range(305):
        buffer.put(pose(*GOOD, nanosec=k))
    assert len(buffer) <= 100 and len(buffer) + buffer.dropped == 305
    assert len(buffer._sent) == len(buffer)
    stamp, _ = buffer.take()
    assert stamp[-1] == 7_000_000_304 and np.all(np.diff(stamp) == 1)


def test_a_conversion_applies_to_the_messages_that_come_after_it():
    buffer = filled(MessageBuffer(SLIDER, "world"), pose(*GOOD))
    buffer.convert_by(lambda messages, sent: [pose(*GOOD, frame="map", nanosec=time) for time in sent], "map")
    assert len(buffer) == 0 and buffer.dropped == 1 and len(buffer.recent()[0]) == 0
    for sent in (3, 4):
        buffer.put(b"of another type", sent, received=10 * sent)
    stamp, received, frames = buffer.recent()
    assert (stamp.tolist(), received.tolist(), frames) == ([7_000_000_003, 7_000_000_004], [30, 40], {"map"})
    assert buffer.take()[0].tolist() == [7_000_000_003, 7_000_000_004] and not buffer.rejected


def test_unreadable_messages_are_not_among_the_recent_ones():
    buffer = filled(MessageBuffer(SLIDER, "world"), pose(*GOOD), b"", pose(*GOOD))
    assert [len(part) for part in buffer.recent()] == [2, 2, 1]


def test_messages_and_a_bag_of_them_give_the_same_streams(tmp_path: Path):
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(40, 7))
    rows[3, 0], rows[7, 3:], rows[11, 5] = np.nan, 0.0, np.inf
    poses = [stamped(START + 1000 * k, row) for k, row in enumerate(rows)]
    forces = [stamped(START + 1000 * k, row[:6]) for k, row in enumerate(rows)]
    messages = [("/slider/pose", POSE, START + k, data) for k, data in enumerate(poses)]
    messages += [("/pusher/pose", POSE, START + k, data) for k, data in enumerate(poses)]
    messages += [("/pusher/wrench", WRENCH, START + k, data) for k, data in enumerate(forces)]
    read = read_recording(write_bag(tmp_path / "some.mcap", messages))
    slider = slider_stream(*filled(MessageBuffer(SLIDER, "world"), *poses).take())
    tip = pusher_stream(*filled(MessageBuffer(PUSHER, "world"), *poses).take())
    force = wrench_stream(*filled(MessageBuffer(samples.WRENCH, "world"), *forces).take())
    for name in ("stamp", "x", "y", "z", "heading"):
        assert np.array_equal(getattr(slider, name), getattr(read.slider, name)), name
    for name in ("stamp", "x", "y", "z", "heading"):
        assert np.array_equal(getattr(tip, name), getattr(read.pusher, name)), name
    assert read.wrench is not None
    for name in ("stamp", "fx", "fy", "torque"):
        assert np.array_equal(getattr(force, name), getattr(read.wrench, name)), name


def test_samples_are_complete_when_every_topic_has_messages_or_after_a_second(monkeypatch: pytest.MonkeyPatch):
    now = [100.0]
    monkeypatch.setattr(sensor_subscriber, "monotonic", lambda: now[0])
    slider: list[bytes] = []
    wrench: list[bytes] = []
    subscriber: Any = SimpleNamespace(_buffers={"slider": slider, "wrench": wrench}, _empty=0.0, _settled=True)
    subscriber._scalars = SimpleNamespace(waiting=lambda: True)
    complete = sensor_subscriber.SensorSubscriber.complete
    assert not complete(subscriber), "no message yet"
    slider.append(b"pose")
    now[0] += 0.9
    assert not complete(subscriber)
    now[0] += 0.2
    assert complete(subscriber), "no wrench for a second"
    wrench.append(b"force")
    subscriber._empty = now[0]
    assert complete(subscriber), "messages of every topic"
    subscriber._settled = False
    assert not complete(subscriber), "the root of the tree may not be known yet"
    now[0] += 1.1
    assert complete(subscriber)
