"""From recorded topics to publishers: types, restamping, sending with back pressure."""

from __future__ import annotations

import importlib
import re
import struct
import time
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.duration import Duration
from rclpy.exceptions import InvalidTopicNameException, ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import HistoryPolicy, ReliabilityPolicy
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions

from push_predictor.errors import PushPredictorError
from push_predictor.nodes.qos import overridden, replay_profile
from push_predictor.recordings.bag.definitions import SCALAR_LAYOUTS
from push_predictor.recordings.bag.reader import RawMessage
from push_predictor.replay.back_pressure import Patience
from push_predictor.replay.clock import SECOND

OWN_TOPICS = frozenset({"clock", "rig", "replay_status"})
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/msg/([A-Za-z][A-Za-z0-9]*)")
_PARTS = 4  # of a history: looked at one by one, for a stall of the machine makes the whole look slow
_FAST = 0.2  # s: where a part fills within this time, the history is not overwritten unasked


def message_class(kind: str) -> type:
    """The Python class of a message type such as std_msgs/msg/String. Raises PushPredictorError if there is none."""
    if not (match := _TYPE.fullmatch(kind)):
        raise PushPredictorError(f"type {kind!r} is not of the form package/msg/Name")
    try:
        found: type = getattr(importlib.import_module(f"{match[1]}.msg"), match[2])
    except (ImportError, AttributeError) as error:
        raise PushPredictorError(f"type {kind} is not installed ({error})") from None
    return found


class Restamper:
    """One offset for the whole replay, so that the first message to go out is stamped as of now."""

    def __init__(self, wall_time: Callable[[], int] = time.time_ns) -> None:
        self._wall_time = wall_time
        self.offset: int | None = None

    def settle(self, log_time: int) -> None:
        """Fix the offset, if this is the first message."""
        if self.offset is None:
            self.offset = self._wall_time() - log_time

    def restamped(self, data: bytes) -> bytes:
        """CDR of a message that begins with a header: bytes 4..11 are its stamp, in the byte order byte 1 names."""
        order = "<" if data[1] & 1 else ">"
        seconds, nanoseconds = struct.unpack_from(f"{order}iI", data, 4)
        stamp = divmod(seconds * SECOND + nanoseconds + (self.offset or 0), SECOND)
        return data[:4] + struct.pack(f"{order}iI", *stamp) + data[12:]


class TopicSender:
    """Publishes one topic's serialized messages; overwritten: messages a subscriber may have lost to KEEP_LAST."""

    def __init__(self, publisher: Publisher, restamper: Restamper | None, patience: Patience) -> None:
        self.publisher = publisher
        self.overwritten = 0
        self._restamper, self._patience = restamper, patience
        profile = publisher.qos_profile
        bounded = profile.history == HistoryPolicy.KEEP_LAST and profile.reliability == ReliabilityPolicy.RELIABLE
        self._depth = profile.depth if bounded else 0
        self._part = max(1, self._depth // _PARTS)
        self._sent = 0  # since the last part
        self._open = 0  # since they were last waited for, no more than the history holds
        self._since = time.monotonic()

    def make_room(self) -> None:
        """At high rates, wait for the readers before the history overwrites what they have not got yet."""
        if not self._depth or self._sent < self._part:
            return
        self._open = min(self._open + self._sent, self._depth)
        if time.monotonic() - self._since < _FAST and self._open + self._part >= self._depth:
            if not self._patience.wait(self.publisher.topic_name, self.acknowledged):
                self.overwritten += self._open
            self._open = 0
        self._sent, self._since = 0, time.monotonic()

    def send(self, message: RawMessage) -> None:
        """Publish. Raises RCLError or struct.error if that cannot be done."""
        if self._restamper is not None:
            self._restamper.settle(message.log_time)
            self.publisher.publish(self._restamper.restamped(message.data))
        else:
            self.publisher.publish(message.data)
        self._sent += 1

    def acknowledged(self) -> bool:
        """Has every matched reliable subscriber got everything?"""
        # Always with timeout 0: the call keeps the interpreter lock, so a wait here would stop every thread.
        return bool(self.publisher.wait_for_all_acked(Duration(seconds=0)))


class ReplayTopics:
    """The publishers of a replay.

    senders: {recorded topic: sender}; skipped: {recorded topic: why it is not published}; unstamped: topics that
    restamping leaves as recorded, because their type does not begin with a header; untimed: scalar topics whose
    messages bear no time, which /clock must tell. Scalars are kept for subscribers that come late: a scalar's type is
    known only once it is published.
    """

    def __init__(
        self,
        node: Node,
        topics: Mapping[str, str],
        recorded_qos: Mapping[str, str],
        overrides: Mapping[str, Mapping[str, Any]],
        restamper: Restamper | None,
        patience: Patience,
    ) -> None:
        self._patience = patience
        self._node, self._qos, self._overrides, self._restamper = node, recorded_qos, overrides, restamper
        self.senders: dict[str, TopicSender] = {}
        self.skipped: dict[str, str] = {}
        self.unstamped: list[str] = []
        self.untimed = frozenset(t for t, k in topics.items() if k in SCALAR_LAYOUTS and not SCALAR_LAYOUTS[k].header)
        for topic, kind in topics.items():
            self._open(topic, kind)

    def make_room(self, message: RawMessage) -> None:
        """Wait until the subscribers of its topic have what it would overwrite, within reason."""
        self.senders[message.topic].make_room()

    def send(self, message: RawMessage) -> bool:
        """Publish a message; False if that failed."""
        try:
            self.senders[message.topic].send(message)
        except (rclpy_implementation.RCLError, struct.error, IndexError) as error:
            self._node.get_logger().error(
                f"{message.topic}: a message of {len(message.data)} bytes cannot be published ({error})",
                throttle_duration_sec=5.0,
            )
            return False
        return True

    def acknowledged(self) -> bool:
        """Have all matched reliable subscribers got everything?"""
        return all(sender.acknowledged() for sender in self.senders.values())

    @property
    def overwritten(self) -> int:
        """Messages that a subscriber may have lost, because it did not acknowledge in time."""
        return sum(sender.overwritten for sender in self.senders.values())

    def _open(self, topic: str, kind: str) -> None:
        name = topic.lstrip("/")
        if name in OWN_TOPICS:
            self.skipped[topic] = "push_replay publishes this topic itself"
            return
        try:
            found = message_class(kind)
        except PushPredictorError as error:
            self.skipped[topic] = str(error)
            return
        fields = found.get_fields_and_field_types()  # type: ignore[attr-defined]  # every message class has it
        stamped = list(fields.values())[:1] == ["std_msgs/Header"]
        if self._restamper is not None and not stamped:
            self.unstamped.append(topic)
        try:
            publisher = self._publisher(topic, name, found, kept=kind in SCALAR_LAYOUTS)
        except InvalidTopicNameException as error:
            self.skipped[topic] = " ".join(str(error).split())
            return
        self.senders[topic] = TopicSender(publisher, self._restamper if stamped else None, self._patience)

    def _publisher(self, topic: str, name: str, found: type, kept: bool) -> Publisher:
        overrides = self._overrides.get(topic.strip("/"), {})
        profile = overridden(replay_profile(self._qos.get(topic, ""), kept), overrides, topic)
        try:
            options = QoSOverridingOptions.with_default_policies()
            return self._node.create_publisher(found, name, profile, qos_overriding_options=options)
        except (InvalidQosOverridesError, ParameterException, RuntimeError, TypeError) as error:
            raise PushPredictorError(f"qos_overrides.{topic}.publisher: {error}, give a QoS policy") from None
