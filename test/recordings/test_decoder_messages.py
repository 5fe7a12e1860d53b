# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Sensor messages become streams, or are rejected, by the rules of reading a recording."""

from __future__ import annotations

import math

import numpy as np
import pytest
from decoding import input_of
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.serialization import serialize_message

from push_predictor.recordings.bag.message_types import POSE as POSE_TYPE
from push_predictor.recordings.bag.message_types import WRENCH as WRENCH_TYPE
from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.decoder import topic_input
from push_predictor.recordings.decoder.decoder import Samples, StreamDecoder
from push_predictor.recordings.decoder.topic_input import TopicInput
from push_predictor.recordings.fields.sources import Columns, FieldReader
from push_predictor.recordings.topics import Topics

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


def decoder(expected: str = "world") -> StreamDecoder:
    """A decoder of the default topics, with their types."""
    found = StreamDecoder(Topics(), expected)
    for name, each in found.inputs().items():
        each.declare((WRENCH_TYPE if name == "wrench" else POSE_TYPE).name, {})
    return found


def filled(found: StreamDecoder, stream: str, *messages: bytes) -> StreamDecoder:
    own = found.inputs()[stream]
    input_of(own, own.kind, *messages)
    return found


def taken(stream: str, *messages: bytes) -> Samples:
    """The samples of messages of one stream."""
    return filled(decoder(), stream, *messages).take()


def test_usable_messages_become_a_stream_in_order():
    found = filled(decoder(), "slider", pose(*GOOD), pose(*GOOD, nanosec=9))
    stream = found.take().slider
    assert stream.stamp.tolist() == [7_000_000_005, 7_000_000_009]
    assert (stream.x[0], stream.y[0], stream.z[0]) == (0.1, -0.2, 0.03)
    assert stream.heading == pytest.approx([0.6, 0.6])
    assert found.of("slider").received == 2 and not found.of("slider").rejected
    assert len(found.take()) == 0


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
        (pose(math.nan, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, frame="map"), "frame_id"),
    ],
    ids=["nan", "infinity", "zero quaternion", "other frame", "no frame", "bad stamp", "cut", "several faults"],
)
def test_an_unusable_slider_pose_is_counted_by_kind_and_the_others_are_used(message: bytes, kind: str):
    found = filled(decoder(), "slider", pose(*GOOD), message, pose(*GOOD))
    assert len(found.take().slider) == 2
    assert dict(found.of("slider").rejected) == {kind: 1}


def test_without_an_expected_frame_any_is_accepted_and_named():
    found = filled(decoder(expected=""), "slider", pose(*GOOD, frame="/map"), pose(*GOOD))
    assert len(found.take().slider) == 2 and found.named == {"map", "world"}


def test_an_expected_frame_may_have_a_slash():
    assert len(taken("slider", pose(*GOOD, frame="/world")).slider) == 1


def test_the_orientation_of_the_tip_is_ignored_and_a_missing_one_is_counted():
    found = filled(decoder(), "pusher", pose(*GOOD[:3], 0.0, 0.0, 0.0, 0.0), pose(*GOOD))
    stream = found.take().pusher
    assert stream.x.tolist() == [0.1, 0.1] and stream.heading.tolist() == [0.0, pytest.approx(0.6)]
    assert found.headless == 1
    assert len(taken("pusher", pose(math.nan, *GOOD[1:])).pusher) == 0


def test_only_the_planar_part_of_a_wrench_must_be_finite():
    found = filled(
        decoder(),
        "wrench",
        wrench(1.0, 2.0, math.nan, math.nan, math.nan, 3.0),
        wrench(math.nan, 0.0, 0.0, 0.0, 0.0, 0.0),
    )
    stream = found.take().wrench
    assert (stream.fx.tolist(), stream.fy.tolist(), stream.torque.tolist()) == ([1.0], [2.0], [3.0])
    assert dict(found.of("wrench").rejected) == {"not finite": 1}


# --- an input --------------------------------------------------------------------------------------------------------


def slider_input(*messages: bytes, live: bool = True) -> TopicInput:
    return input_of(StreamDecoder(Topics()).inputs()["slider"], POSE_TYPE.name, *messages, live=live)


def test_a_live_topic_that_nobody_takes_drops_the_oldest_and_counts_them(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(topic_input, "LIMIT", 100)
    own = slider_input(*(pose(*GOOD, nanosec=k) for k in range(305)))
    assert len(own) == 100 and own.dropped == 205
    stamp = own.take().stamp
    assert stamp[-1] == 7_000_000_304 and np.all(np.diff(stamp) == 1)


def test_decoded_messages_that_nobody_takes_are_dropped_too(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(topic_input, "LIMIT", 100)
    own = slider_input()
    for k in range(305):
        input_of(own, POSE_TYPE.name, pose(*GOOD, nanosec=k))
        own.recent()
    assert len(own) == 100 and own.dropped == 205
    assert own.take().stamp.tolist() == [7_000_000_205 + k for k in range(100)]


def test_messages_that_come_while_others_are_decoded_replace_the_oldest(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(topic_input, "LIMIT", 100)
    own = slider_input(*(pose(*GOOD, nanosec=k) for k in range(100)))
    read = FieldReader.read

    def read_slowly(reader: FieldReader, messages: Messages) -> Columns:
        monkeypatch.setattr(FieldReader, "read", read)
        input_of(own, POSE_TYPE.name, *(pose(*GOOD, nanosec=k) for k in range(100, 110)))
        return read(reader, messages)

    monkeypatch.setattr(FieldReader, "read", read_slowly)
    own.recent()
    assert len(own) == 100 and own.dropped == 10
    assert own.take().stamp.tolist() == [7_000_000_010 + k for k in range(100)]


def test_a_bag_has_no_limit(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(topic_input, "LIMIT", 100)
    own = slider_input(*(pose(*GOOD, nanosec=k) for k in range(305)), live=False)
    assert len(own) == 305 and own.dropped == 0


def test_another_type_applies_to_the_messages_that_come_after_it():
    own = slider_input(pose(*GOOD))
    own.declare("nav_msgs/msg/Odometry", {})
    assert len(own) == 0 and own.dropped == 1 and len(own.recent()[0]) == 0
    own.put(Messages.of("slider/pose", POSE_TYPE.name, [3], [pose(*GOOD)]))
    assert len(own) == 0 and own.foreign == {POSE_TYPE.name: 1} and own.received == 1


def test_the_recent_messages_are_those_that_are_readable_with_their_receipt_and_frames():
    own = slider_input(pose(*GOOD, nanosec=1), b"", pose(*GOOD, nanosec=2, frame="map"))
    stamp, received, frames = own.recent()
    assert (stamp.tolist(), received.tolist()) == ([7_000_000_001, 7_000_000_002], [0, 2])
    assert frames == {"world", "map"} == own.named
    assert len(own) == 3 and len(own.take().stamp) == 3, "they wait as before"
