# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A live stream from a topic: subscribed with the type of its publishers, converted by the code that reads bags."""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic

from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from push_predictor.errors import PushPredictorError, RecordingError
from push_predictor.nodes.following import FollowingSubscription
from push_predictor.nodes.message_text import definition_of
from push_predictor.nodes.validator.sensors.stream_source import DEPTH, SILENT, reliability_text, resolved
from push_predictor.online.message_buffer import MessageBuffer, unchanged
from push_predictor.online.sensors.topic_report import TopicReport, stamp_figures
from push_predictor.recordings.fields.sources import FieldReader, Source, Target, definitions_of, field_to_read
from push_predictor.recordings.samples import SampleRules

NO_WRENCH = "No publisher: contact is found from geometry alone."


class TopicStream:
    """Messages of the topic of a source. name: slider, pusher or wrench; frame_id: as in MessageBuffer.

    Call `look` and `report` in the executor's thread; not at the same time as `move`.
    """

    def __init__(
        self, node: Node, name: str, source: Source, target: Target, rules: SampleRules, frame_id: str
    ) -> None:
        self.buffer = MessageBuffer(rules, frame_id)
        self._name, self._source, self._target, self._frame_id = name, resolved(node, source), target, frame_id
        self._subscription = FollowingSubscription(node, source.topic, DEPTH, earlier=False, overridable=True)
        self._read: dict[str, FieldReader] = {}  # by type
        self._refusals: dict[str, str] = {}  # by type
        self._kind = ""  # of the subscription
        self._offered: list[tuple[str, ReliabilityPolicy]] = []  # type and reliability of each publisher
        self._heard = monotonic()  # when the last message came, or the last publisher
        if not source.field:
            self._follow(target.type, [])

    @property
    def lost(self) -> int:
        """How many messages were overwritten or missed."""
        return self._subscription.lost

    def look(self) -> None:
        """Subscribe to the type that the publishers have, as they offer it."""
        publishers = self._subscription.publishers()
        if not self._offered:
            self._heard = monotonic()
        self._offered = [(each.topic_type, each.qos_profile.reliability) for each in publishers]
        usable = [kind for kind in self._kinds if self._understood(kind)]
        if len(usable) == 1:
            self._follow(usable[0], [each for each in publishers if each.topic_type == usable[0]])

    def move(self) -> None:
        """Move arrived messages from the middleware into the buffer."""
        for taken in self._subscription.taken():
            self.buffer.put(taken.message, taken.sent, taken.received)
            self._heard = monotonic()

    def report(self) -> TopicReport:
        """What is known of the topic now."""
        stamp, received, found = self.buffer.recent()
        frames = tuple(sorted(found - {""}))
        return TopicReport(
            stream=self._name,
            topic=self._source.text,
            kind=self._kind if self._kind in self._kinds or not self._kinds else " and ".join(self._kinds),
            reliability=reliability_text(self._subscription.reliability),
            frames=frames,
            figures=stamp_figures(stamp, received),
            problem=self._problem(frames),
            refused=self._refused,
            note=NO_WRENCH if self._name == "wrench" and not self._offered else "",
        )

    @property
    def _kinds(self) -> list[str]:
        return sorted({kind for kind, _ in self._offered})

    @property
    def _refused(self) -> bool:
        return bool(self._offered) and len([kind for kind in self._kinds if kind in self._read]) != 1

    def _problem(self, frames: Sequence[str]) -> str:
        if not self._offered:
            return "" if self._name == "wrench" else "No publisher."
        if self._refused:
            return next(iter(filter(None, map(self._refusals.get, self._kinds))), "One type of publishers is accepted.")
        offered = [reliability for kind, reliability in self._offered if kind == self._kind]
        if self._subscription.reliability == ReliabilityPolicy.RELIABLE and ReliabilityPolicy.BEST_EFFORT in offered:
            return "A publisher is best effort, but a QoS override demands reliable: none of its messages is received."
        if self._frame_id and (others := [frame for frame in frames if frame != self._frame_id]):
            names = " and ".join(map(repr, others))
            wrench = ", or wrench_frame to tip or a frame of tf" if self._name == "wrench" else ""
            return f"frame_id {names} is not accepted, give {self._frame_id!r}, or set world_frame or frame_id{wrench}."
        if monotonic() - self._heard > SILENT:
            return f"No message for over {SILENT:g} s."
        return ""

    def _understood(self, kind: str) -> bool:
        """Whether messages of a type have what the stream needs; remembers why not."""
        if kind not in self._read and kind not in self._refusals:
            try:
                schemas = {kind: definition_of(kind)}
                field = field_to_read(self._source, kind, self._target, schemas, "")
                self._read[kind] = FieldReader(self._target, kind, field, definitions_of(kind, schemas))
            except RecordingError as error:
                self._refusals[kind] = str(error)
            except PushPredictorError as error:
                self._refusals[kind] = str(self._source.error("", str(error)))
        return kind in self._read

    def _follow(self, kind: str, publishers: Sequence[TopicEndpointInfo]) -> None:
        if kind != self._kind and kind in self._read:
            self._convert(kind)
        self._kind = kind
        self._subscription.follow(kind, publishers)

    def _convert(self, kind: str) -> None:
        """Read the messages that come from now on as those of a type."""
        reader = self._read[kind]
        if kind == self._target.type and not self._source.field:
            self.buffer.convert_by(unchanged, self._frame_id)
            return
        # Without a header a message names no frame; it is then dated by its sending.
        self.buffer.convert_by(reader.read, self._frame_id if reader.timed else "")
