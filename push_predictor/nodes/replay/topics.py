# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The publishers of a replay: one per recorded topic, with message type and QoS."""

from __future__ import annotations

import importlib
import re
import struct
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from rclpy.exceptions import InvalidTopicNameException, ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions

from push_predictor.errors import PushPredictorError
from push_predictor.nodes.qos import overridden, replay_profile
from push_predictor.nodes.replay.topic_sender import TopicSender
from push_predictor.recordings.bag.definitions import SCALAR_LAYOUTS
from push_predictor.recordings.bag.reader import RawMessage
from push_predictor.recordings.fields.sources import TF_TYPES
from push_predictor.replay.flow_control import FlowControl
from push_predictor.replay.restamper import Restamper

OWN_TOPICS = frozenset({"clock", "rig", "replay_status"})
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/msg/([A-Za-z][A-Za-z0-9]*)")


def message_class(kind: str) -> type:
    """The Python class of a message type such as std_msgs/msg/String. Raises PushPredictorError if there is none."""
    if not (match := _TYPE.fullmatch(kind)):
        raise PushPredictorError(f"type {kind!r} is not of the form package/msg/Name")
    try:
        found: type = getattr(importlib.import_module(f"{match[1]}.msg"), match[2])
    except (ImportError, AttributeError) as error:
        raise PushPredictorError(f"type {kind} is not installed ({error})") from None
    return found


class ReplayTopics:
    """The publishers of a replay.

    senders: {recorded topic: sender}. skipped: {recorded topic: why it is not published}. unstamped: topics without a
    header in front, which restamping does not change. untimed: topics without a stamp that may contain a scalar: only
    /clock gives their time. Publishers of scalars keep their messages for late subscribers, which learn the type only
    from the publisher.
    """

    def __init__(
        self,
        node: Node,
        topics: Mapping[str, str],
        recorded_qos: Mapping[str, str],
        overrides: Mapping[str, Mapping[str, Any]],
        restamper: Restamper | None,
        flow_control: FlowControl,
    ) -> None:
        self._node, self._qos, self._overrides = node, recorded_qos, overrides
        self._restamper, self._flow_control = restamper, flow_control
        self.senders: dict[str, TopicSender] = {}
        self.skipped: dict[str, str] = {}
        self.unstamped: list[str] = []
        self.untimed: set[str] = set()
        for topic, kind in topics.items():
            self._open(topic, kind)

    def prepare(self, message: RawMessage) -> Callable[[], bool]:
        """Wait, for a limited time, for the subscribers that a message would make lose another.

        Returns the call that publishes the message: False if that failed.
        """
        sender = self.senders[message.topic]
        sender.make_room()
        return partial(self._send, sender.send, message)

    def acknowledged(self) -> bool:
        """Whether all matched reliable subscribers have acknowledged everything."""
        return all(sender.acknowledged() for sender in self.senders.values())

    @property
    def overwritten(self) -> int:
        """Number of messages that a subscriber may have lost because it did not acknowledge in time."""
        return sum(sender.overwritten for sender in self.senders.values())

    def _send(self, send: Callable[[RawMessage], None], message: RawMessage) -> bool:
        try:
            send(message)
        except (rclpy_implementation.RCLError, struct.error, IndexError) as error:
            self._node.get_logger().error(
                f"{message.topic}: a message of {len(message.data)} bytes cannot be published ({error})",
                throttle_duration_sec=5.0,
            )
            return False
        return True

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
        if not stamped and kind not in TF_TYPES:
            self.untimed.add(topic)
        if self._restamper is not None and not stamped:
            self.unstamped.append(topic)
        try:
            publisher = self._publisher(topic, name, found, kept=kind in SCALAR_LAYOUTS)
        except InvalidTopicNameException as error:
            self.skipped[topic] = " ".join(str(error).split())
            return
        self.senders[topic] = TopicSender(publisher, self._restamper if stamped else None, self._flow_control)

    def _publisher(self, topic: str, name: str, found: type, kept: bool) -> Publisher:
        overrides = self._overrides.get(topic.strip("/"), {})
        profile = overridden(replay_profile(self._qos.get(topic, ""), kept), overrides, topic)
        try:
            options = QoSOverridingOptions.with_default_policies()
            return self._node.create_publisher(found, name, profile, qos_overriding_options=options)
        except (InvalidQosOverridesError, ParameterException, RuntimeError, TypeError) as error:
            raise PushPredictorError(f"qos_overrides.{topic}.publisher: {error}, give a QoS policy") from None
