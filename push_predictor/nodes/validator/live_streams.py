# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The live streams of a decoder, from a topic or a frame of tf: subscribed with the type and QoS of the publishers."""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic

import numpy as np
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from push_predictor.errors import PushPredictorError, RecordingError
from push_predictor.nodes.polling import FollowingSubscription, Taken
from push_predictor.nodes.qos import DEEPEST
from push_predictor.online.topic_report import TopicReport, stamp_figures
from push_predictor.recordings.bag.message_types import definition_text
from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.decoder.sources import STATIC
from push_predictor.recordings.decoder.topic_input import RECENT, TopicInput
from push_predictor.recordings.decoder.transform_buffer import TransformBuffer
from push_predictor.recordings.fields.sources import TF_TYPES, Source
from push_predictor.types import IntArray

SILENT = 5.0  # s without a sample that are reported
TF_TYPE = TF_TYPES[0]
NOT_INSTALLED = "install ros-jazzy-tf2-msgs, or run scripts/install_tf2_msgs.sh"
NO_WRENCH = "No publisher: contact is found from geometry alone."


class TopicStream:
    """Moves the messages of a topic into an input of a decoder.

    earlier: also take what was sent before. Call `look` and `report` in the executor's thread; not at the same time as
    `move`.
    """

    def __init__(self, node: Node, own: TopicInput, earlier: bool = False) -> None:
        self.input = own
        topic = own.source.topic
        self._subscription = FollowingSubscription(node, topic, DEEPEST, earlier=earlier, overridable=not earlier)
        self.name = self._subscription.name + own.source.text[len(topic) :]  # after remapping, for people
        self.refusals: dict[str, str] = {}  # by type
        self._offered: list[tuple[str, ReliabilityPolicy]] = []  # type and reliability of each publisher
        self._heard = monotonic()  # when the last message came, or the last publisher
        if own.target.type and not own.source.field:
            self._follow(own.target.type, [])

    @property
    def lost(self) -> int:
        """How many messages were overwritten or missed."""
        return self._subscription.lost

    @property
    def kinds(self) -> list[str]:
        """The types of the publishers."""
        return sorted({kind for kind, _ in self._offered})

    @property
    def refused(self) -> bool:
        """Whether there are publishers, but not of one type that fits."""
        return bool(self._offered) and len(self._usable()) != 1

    @property
    def refusal(self) -> str:
        """Why the types of the publishers do not fit."""
        return next(iter(filter(None, map(self.refusals.get, self.kinds))), "One type of publishers is accepted.")

    def look(self) -> None:
        """Subscribe to the type that the publishers have, as they offer it."""
        publishers = self._subscription.publishers()
        if not self._offered:
            self._heard = monotonic()
        self._offered = [(each.topic_type, each.qos_profile.reliability) for each in publishers]
        if len(usable := self._usable()) == 1:
            self._follow(usable[0], [each for each in publishers if each.topic_type == usable[0]])

    def move(self) -> None:
        """Move arrived messages from the middleware into the input."""
        if taken := self.taken():
            self.input.put(*as_messages(taken, self.input.source.topic, self.input.kind))

    def taken(self) -> list[Taken]:
        """The messages that have arrived."""
        found = [*self._subscription.taken()]
        self._heard = monotonic() if found else self._heard
        return found

    def report(self, stream: str) -> TopicReport:
        """What is known of the topic now."""
        stamp, received, found = self.input.recent()
        frames, kind = tuple(sorted(found - {""})), self.input.kind
        return TopicReport(
            stream=stream,
            topic=self.name,
            kind=kind if kind in self.kinds or not self.kinds else " and ".join(self.kinds),
            reliability=reliability_text(self._subscription.reliability),
            frames=frames,
            figures=stamp_figures(stamp, received),
            problem=self._problem(stream, frames),
            refused=self.refused,
            note=NO_WRENCH if stream == "wrench" and not self._offered else "",
        )

    def _problem(self, stream: str, frames: Sequence[str]) -> str:
        if not self._offered:
            return "" if stream == "wrench" else "No publisher."
        if self.refused:
            return self.refusal
        offered = [reliability for kind, reliability in self._offered if kind == self.input.kind]
        if self._subscription.reliability == ReliabilityPolicy.RELIABLE and ReliabilityPolicy.BEST_EFFORT in offered:
            return "A publisher is best effort, but a QoS override demands reliable: none of its messages is received."
        expected = self.input.expected
        if expected and (others := [frame for frame in frames if frame.strip("/") != expected]):
            wrench = ", or wrench_frame to tip or a frame of tf" if stream == "wrench" else ""
            names = " and ".join(map(repr, others))
            return f"frame_id {names} is not accepted, give {expected!r}, or set world_frame{wrench}."
        if monotonic() - self._heard > SILENT:
            return f"No message for over {SILENT:g} s."
        return ""

    def _usable(self) -> list[str]:
        return [kind for kind in self.kinds if self._understood(kind)]

    def _understood(self, kind: str) -> bool:
        """Whether messages of a type have what the stream needs; remembers why not."""
        if kind == self.input.kind:
            return True
        if kind not in self.refusals:
            try:
                self.input.check(kind, {kind: definition_text(kind)})
                self.refusals[kind] = ""
            except RecordingError as error:
                self.refusals[kind] = str(error)
        return not self.refusals[kind]

    def _follow(self, kind: str, publishers: Sequence[TopicEndpointInfo]) -> None:
        if kind != self.input.kind:
            self.input.declare(kind, {kind: definition_text(kind)})
        try:
            self._subscription.follow(kind, publishers)
        except PushPredictorError as error:
            self.refusals[kind] = f"{error}."


class TransformTopics:
    """The subscriptions to a tf topic and its static one; messages go into the buffer.

    Call `look` in the executor's thread; not at the same time as `move`.
    """

    def __init__(self, node: Node, topic: str, buffer: TransformBuffer) -> None:
        self.buffer = buffer
        self.problem, self.refused = "No publisher.", False
        self.heard = monotonic()  # when the last message came, or the last publisher
        self._moving = FollowingSubscription(node, topic, DEEPEST, earlier=False, overridable=True)
        self._static = FollowingSubscription(node, topic + STATIC, DEEPEST)
        self._published = False

    @property
    def lost(self) -> int:
        """How many messages were overwritten or missed."""
        return self._moving.lost + self._static.lost

    @property
    def reliability(self) -> str:
        """Of the subscription to the topic that is not static."""
        return reliability_text(self._moving.reliability)

    def look(self) -> None:
        """Subscribe as the publishers offer the topics."""
        refusals = [self._follow(subscription) for subscription in (self._static, self._moving)]
        published = bool(self._moving.publishers())
        self.problem = next(filter(None, refusals), "" if published else "No publisher.")
        self.refused = any(refusals)
        if published and not self._published:
            self.heard = monotonic()
        self._published = published

    def _follow(self, subscription: FollowingSubscription) -> str:
        """Subscribe as the publishers offer the topic; returns why that is not possible, empty if it is."""
        publishers = subscription.publishers()
        usable = [each for each in publishers if each.topic_type == TF_TYPE]
        if publishers and not usable:
            kinds = " and ".join(sorted({repr(each.topic_type) for each in publishers}))
            return f"{subscription.name} is of type {kinds}, {TF_TYPE} is accepted."
        if not usable and subscription.reliability is not None:
            return ""
        try:
            subscription.follow(TF_TYPE, usable)
        except PushPredictorError as error:
            return f"{error}: {NOT_INSTALLED}."
        return ""

    def move(self) -> None:
        """Move arrived messages from the middleware into the buffer."""
        for static, subscription in ((True, self._static), (False, self._moving)):
            if taken := [*subscription.taken()]:
                messages, arrived = as_messages(taken, subscription.name, TF_TYPE)
                self.buffer.put(messages, static, arrived)
                self.heard = self.heard if static else monotonic()


class FrameStream:
    """What is known of the poses of a frame. name: of the source, after remapping."""

    def __init__(self, node: Node, source: Source, topics: TransformTopics) -> None:
        self.name = node.resolve_topic_name(source.topic) + source.text[len(source.topic) :]
        self._source, self._topics = source, topics

    @property
    def lost(self) -> int:
        """How many messages of tf were overwritten or missed."""
        return self._topics.lost

    def report(self, stream: str) -> TopicReport:
        """What is known of the frame now."""
        transforms, frame = self._topics.buffer, self._source.frame
        return TopicReport(
            stream=stream,
            topic=self.name,
            kind=TF_TYPE,
            reliability=self._topics.reliability,
            frames=(transforms.world,) if transforms.world else (),
            figures=stamp_figures(transforms.recent(frame, RECENT), None),
            problem=self._problem(),
            refused=self._topics.refused,
        )

    def _problem(self) -> str:
        if self._topics.problem:
            return self._topics.problem
        buffer, frame = self._topics.buffer, self._source.frame
        if problem := buffer.problem(frame):
            advice = "; set world_frame" if buffer.lacks_world(frame) else ""
            return f"{problem[0].upper()}{problem[1:]}{advice}."
        if monotonic() - self._topics.heard > SILENT:
            return f"No message for over {SILENT:g} s."
        return ""


def as_messages(taken: Sequence[Taken], topic: str, kind: str) -> tuple[Messages, IntArray]:
    """Messages as a decoder takes them, dated by their sending, and when they arrived, ns."""
    arrived = np.array([message.received for message in taken], np.int64)
    return Messages.of(
        topic, kind, [message.sent for message in taken], [message.message for message in taken]
    ), arrived


def reliability_text(reliability: ReliabilityPolicy | None) -> str:
    """In words; empty for none."""
    return "" if reliability is None else reliability.name.lower().replace("_", " ")
