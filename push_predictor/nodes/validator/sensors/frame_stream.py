# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Live streams from tf: one pair of subscriptions to /tf and /tf_static, and the poses of frames in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from time import monotonic

from rclpy.node import Node

from push_predictor.errors import PushPredictorError
from push_predictor.nodes.following import FollowingSubscription
from push_predictor.nodes.validator.sensors.stream_source import DEPTH, SILENT, reliability_text, resolved
from push_predictor.online.message_buffer import RECENT
from push_predictor.online.sensors.topic_report import TopicReport, stamp_figures
from push_predictor.online.sensors.transform_buffer import TransformBuffer
from push_predictor.recordings.bag.cdr import POSE_STAMPED, encode
from push_predictor.recordings.fields.sources import TF_TYPES, Source
from push_predictor.recordings.samples import SampleRules, check_samples
from push_predictor.recordings.select import STATIC
from push_predictor.types import Array, IntArray

TYPE = TF_TYPES[0]
NOT_INSTALLED = "install ros-jazzy-tf2-msgs, or run scripts/install_tf2_msgs.sh"


class TransformTopics:
    """The subscriptions to a tf topic and its static one.

    frames: the streams that are frames in it; world and turned: as in TransformBuffer. Call `look` in the executor's
    thread; not at the same time as `move`.
    """

    def __init__(self, node: Node, topic: str, frames: Sequence[str], world: str, turned: str = "") -> None:
        self.buffer = TransformBuffer(frames, world, turned)
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
            for taken in subscription.taken():
                self.buffer.put(taken.message, static)
                self.heard = self.heard if static else monotonic()


class FrameBuffer:
    """The poses of a frame, checked as those of a topic."""

    def __init__(self, transforms: TransformBuffer, frame: str, rules: SampleRules) -> None:
        self._transforms, self._frame, self._rules = transforms, frame, rules
        self._unusable: Counter[str] = Counter()

    def __len__(self) -> int:
        return len(self._transforms)

    @property
    def received(self) -> int:
        """How many samples there have been."""
        return self._transforms.received(self._frame)

    @property
    def dropped(self) -> int:
        """Messages that were dropped before their poses were taken."""
        return self._transforms.dropped

    @property
    def rejected(self) -> Counter[str]:
        """Unusable samples, by reason."""
        return self._unusable + self._transforms.rejected(self._frame)

    def take(self) -> tuple[IntArray, Array]:
        """Stamps (n,) in ns and numbers (n, 7) of the usable poses since the last call."""
        stamp, rows = self._transforms.take(self._frame)
        checked = check_samples(encode(stamp, rows, POSE_STAMPED, self._transforms.world), self._rules)
        self._unusable.update(checked.rejected)
        return checked.stamp[checked.usable], checked.values[checked.usable]


class FrameStream:
    """The poses of the frame of a source. name: slider or pusher."""

    def __init__(self, node: Node, name: str, source: Source, topics: TransformTopics, rules: SampleRules) -> None:
        self.buffer = FrameBuffer(topics.buffer, source.frame, rules)
        self._name, self._source, self._topics = name, resolved(node, source), topics

    @property
    def lost(self) -> int:
        """How many messages of tf were overwritten or missed."""
        return self._topics.lost

    def report(self) -> TopicReport:
        """What is known of the frame now."""
        transforms, frame = self._topics.buffer, self._source.frame
        stamp = transforms.recent(frame, RECENT)
        figures = stamp_figures(stamp, None)
        return TopicReport(
            stream=self._name,
            topic=self._source.text,
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
        if problem := self._topics.buffer.problem(self._source.frame):
            advice = "; set world_frame" if f"no frame {self._topics.buffer.world!r}" in problem else ""
            return f"{problem[0].upper()}{problem[1:]}{advice}."
        if monotonic() - self._topics.heard > SILENT:
            return f"No message for over {SILENT:g} s."
        return ""
