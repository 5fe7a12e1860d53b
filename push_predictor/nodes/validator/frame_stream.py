# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Live streams from tf: one pair of subscriptions to /tf and /tf_static, and the poses of frames in it."""

from __future__ import annotations

from time import monotonic

from rclpy.node import Node

from push_predictor.errors import PushPredictorError
from push_predictor.nodes.polling import FollowingSubscription
from push_predictor.nodes.validator.topic_stream import DEPTH, SILENT, as_messages, reliability_text
from push_predictor.online.topic_report import TopicReport, stamp_figures
from push_predictor.recordings.decoder.sources import STATIC
from push_predictor.recordings.decoder.topic_input import RECENT
from push_predictor.recordings.decoder.transform_buffer import TransformBuffer
from push_predictor.recordings.fields.sources import TF_TYPES, Source

TYPE = TF_TYPES[0]
NOT_INSTALLED = "install ros-jazzy-tf2-msgs, or run scripts/install_tf2_msgs.sh"


class TransformTopics:
    """The subscriptions to a tf topic and its static one; messages go into the buffer.

    Call `look` in the executor's thread; not at the same time as `move`.
    """

    def __init__(self, node: Node, topic: str, buffer: TransformBuffer) -> None:
        self.buffer = buffer
        self.problem, self.refused = "No publisher.", False
        self.heard = monotonic()  # when the last message came, or the last publisher
        self._moving = FollowingSubscription(node, topic, DEPTH, earlier=False, overridable=True)
        self._static = FollowingSubscription(node, topic + STATIC, DEPTH)
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
        usable = [each for each in publishers if each.topic_type == TYPE]
        if publishers and not usable:
            kinds = " and ".join(sorted({repr(each.topic_type) for each in publishers}))
            return f"{subscription.name} is of type {kinds}, {TYPE} is accepted."
        if not usable and subscription.reliability is not None:
            return ""
        try:
            subscription.follow(TYPE, usable)
        except PushPredictorError as error:
            return f"{error}: {NOT_INSTALLED}."
        return ""

    def move(self) -> None:
        """Move arrived messages from the middleware into the buffer."""
        for static, subscription in ((True, self._static), (False, self._moving)):
            if taken := [*subscription.taken()]:
                self.buffer.put(as_messages(taken, subscription.name, TYPE)[0], static, live=True)
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
        stamp = transforms.recent(frame, RECENT)
        figures = stamp_figures(stamp, None)
        return TopicReport(
            stream=stream,
            topic=self.name,
            kind=TYPE,
            reliability=self._topics.reliability,
            frames=(transforms.world,) if transforms.world else (),
            figures=figures,
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
