# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The live streams of a decoder, from a topic or a frame of tf: subscribed with the type and QoS of the publishers."""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic

import numpy as np
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy

from push_predictor.errors import PushPredictorError, RecordingError
from push_predictor.nodes.polling import FollowingSubscription, Taken
from push_predictor.nodes.qos import message_class
from push_predictor.online.stream_health import TopicReport, stamp_figures
from push_predictor.recordings.bag.message_types import definition_text
from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.decoder.poses import PoseFrame
from push_predictor.recordings.decoder.sources import STATIC, STREAMS
from push_predictor.recordings.decoder.topic_input import RECENT, TopicInput
from push_predictor.recordings.decoder.transform_buffer import TransformBuffer
from push_predictor.recordings.fields.sources import TF_TYPES
from push_predictor.types import IntArray

SILENT = 5.0  # s without a sample that are reported
TF_TYPE = TF_TYPES[0]
NOT_INSTALLED = "install ros-jazzy-tf2-msgs, or run scripts/install_tf2_msgs.sh"
NO_WRENCH = "No publisher: contact is found from geometry alone."


class TopicStream:
    """Moves the messages of a topic into an input of a decoder: those of slider, pusher or wrench, or of a scalar.

    Of a scalar it also takes what was sent before. Call `look` and `report` in the executor's thread; not at the same
    time as `move`. own: counts the samples.
    """

    def __init__(self, node: Node, stream: str, own: TopicInput) -> None:
        self.own, self._stream, self._is_sensor = own, stream, stream in STREAMS
        topic, first = own.source.topic, "" if own.source.field else own.target.type
        self.subscription = FollowingSubscription(node, topic, self._unfit, first=first, live=self._is_sensor)
        self.name = self.subscription.name + own.source.text[len(topic) :]  # after remapping, for people
        self._known: dict[str, str] = {}  # why a type does not fit, '' if it does

    @property
    def lost(self) -> int:
        """How many messages were overwritten or missed."""
        return self.subscription.lost

    def look(self) -> None:
        """Subscribe to the type that the publishers have, as they offer it."""
        self.subscription.look()
        if (kind := self.subscription.kind) not in ("", self.own.kind):
            self.own.declare(kind, {kind: definition_text(kind)})

    def move(self) -> None:
        """Move arrived messages from the middleware into the input."""
        if taken := [*self.subscription.taken()]:
            self.own.put(*as_messages(taken, self.own.source.topic, self.own.kind))

    def report(self) -> TopicReport:
        """What is known of the topic now."""
        stamp, received, found = self.own.recent()
        frames, topic, kind = tuple(sorted(found - {""})), self.subscription, self.own.kind
        return TopicReport(
            stream=self._stream,
            topic=self.name,
            kind=kind if kind in topic.kinds or not topic.kinds else " and ".join(topic.kinds),
            reliability=reliability_text(topic.reliability),
            frames=frames,
            figures=stamp_figures(stamp, received),
            problem=self._problem(frames),
            refused=self._is_sensor and bool(topic.problem),
            note=NO_WRENCH if self._stream == "wrench" and not topic.offered else "",
        )

    def _problem(self, frames: Sequence[str]) -> str:
        own = self.subscription
        if not own.offered:
            kept = not self._is_sensor and self.own.received  # a scalar that was sent once is valid until the next
            return "" if self._stream == "wrench" or kept else "No publisher."
        if own.problem:
            return own.problem
        offered = [each.qos_profile.reliability for each in own.offered if each.topic_type == own.kind]
        if own.reliability == ReliabilityPolicy.RELIABLE and ReliabilityPolicy.BEST_EFFORT in offered:
            return "A publisher is best effort, but a QoS override demands reliable: none of its messages is received."
        expected = self.own.expected
        if expected and (others := [frame for frame in frames if frame.strip("/") != expected]):
            wrench = ", or wrench_frame to tip or a frame of tf" if self._stream == "wrench" else ""
            names = " and ".join(map(repr, others))
            return f"frame_id {names} is not accepted, give {expected!r}, or set world_frame{wrench}."
        return silence(own) if self._is_sensor else ""

    def _unfit(self, kind: str) -> str:
        """Why messages of a type do not have what the stream needs, '' if they do."""
        if kind not in self._known:
            try:
                self.own.check(kind, {kind: definition_text(kind)})
                self._known[kind] = ""
            except RecordingError as error:
                self._known[kind] = str(error)
        return self._known[kind]


class TransformTopics:
    """The subscriptions to a tf topic and its static one; messages go into the buffer.

    Call `look` in the executor's thread; not at the same time as `move`.
    """

    def __init__(self, node: Node, topic: str, buffer: TransformBuffer) -> None:
        self.buffer = buffer
        self.moving = FollowingSubscription(node, topic, _no_tf, first=TF_TYPE, live=True)
        self._static = FollowingSubscription(node, topic + STATIC, _no_tf, first=TF_TYPE)

    @property
    def lost(self) -> int:
        """How many messages were overwritten or missed."""
        return self.moving.lost + self._static.lost

    @property
    def refusal(self) -> str:
        """Why the topics cannot be subscribed to, '' if they can."""
        return self._static.problem or self.moving.problem

    @property
    def problem(self) -> str:
        """In words, why there are no transforms; '' if nothing is wrong with the topics."""
        return self.refusal or ("" if self.moving.offered else "No publisher.")

    def look(self) -> None:
        """Subscribe as the publishers offer the topics."""
        self._static.look()
        self.moving.look()

    def move(self) -> None:
        """Move arrived messages from the middleware into the buffer."""
        for static, subscription in ((True, self._static), (False, self.moving)):
            if taken := [*subscription.taken()]:
                messages, arrived = as_messages(taken, subscription.name, TF_TYPE)
                self.buffer.put(messages, static, arrived)


def _no_tf(kind: str) -> str:
    """Why a type is not the one of transforms, or is not available; '' if it is."""
    if kind != TF_TYPE:
        return f"It is of type {kind!r}, {TF_TYPE} is accepted."
    try:
        message_class(kind)
    except PushPredictorError as error:
        return f"{error}: {NOT_INSTALLED}."
    return ""


class FrameStream:
    """What is known of the poses of a frame. own: counts the samples."""

    def __init__(self, node: Node, stream: str, own: PoseFrame, topics: TransformTopics) -> None:
        self.own, self._stream, self._topics = own, stream, topics
        topic = own.source.topic
        self._name = node.resolve_topic_name(topic) + own.source.text[len(topic) :]  # after remapping

    @property
    def lost(self) -> int:
        """How many messages of tf were overwritten or missed."""
        return self._topics.lost

    def report(self) -> TopicReport:
        """What is known of the frame now."""
        return TopicReport(
            stream=self._stream,
            topic=self._name,
            kind=TF_TYPE,
            reliability=reliability_text(self._topics.moving.reliability),
            frames=tuple(self.own.named),
            figures=stamp_figures(self.own.recent(RECENT), None),
            problem=self._problem(),
            refused=bool(self._topics.refusal),
        )

    def _problem(self) -> str:
        if self._topics.problem:
            return self._topics.problem
        if problem := self.own.problem:
            advice = "; set world_frame" if self.own.lacks_world else ""
            return f"{problem[0].upper()}{problem[1:]}{advice}."
        return silence(self._topics.moving)


def as_messages(taken: Sequence[Taken], topic: str, kind: str) -> tuple[Messages, IntArray]:
    """Messages as a decoder takes them, dated by their sending, and when they arrived, ns."""
    arrived = np.array([message.received for message in taken], np.int64)
    return Messages.of(
        topic, kind, [message.sent for message in taken], [message.message for message in taken]
    ), arrived


def silence(topic: FollowingSubscription) -> str:
    """In words, that no message comes; '' if that is not so."""
    return f"No message for over {SILENT:g} s." if monotonic() - topic.heard > SILENT else ""


def reliability_text(reliability: ReliabilityPolicy | None) -> str:
    """In words; empty for none."""
    return "" if reliability is None else reliability.name.lower().replace("_", " ")
