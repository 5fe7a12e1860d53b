# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The publishers of a replay: one per recorded topic, with message type and QoS."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rclpy.duration import Duration
from rclpy.exceptions import InvalidTopicNameException, ParameterException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import HistoryPolicy, ReliabilityPolicy
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions

from push_predictor.errors import PushPredictorError, RequestError
from push_predictor.nodes.qos import message_class, replay_profile
from push_predictor.nodes.runtime import of_rcl
from push_predictor.recordings.bag.messages import RawMessage
from push_predictor.recordings.fields.sources import SCALAR_FIELDS, TF_TYPES

OWN_TOPICS = frozenset({"clock", "rig", "replay_status"})
PARTS = 4  # of a publisher's history, after each of which its subscribers are looked at
PATIENCE = 5.0  # s that subscribers are waited for
POLL = 0.001  # s


class ReplayTopics:
    """The publishers of a replay.

    publishers: by recorded topic. skipped: {recorded topic: why it is not published}. untimed: topics without a stamp
    that may contain a scalar: only /clock gives their time. overwritten: messages that a subscriber may have lost
    because it did not acknowledge in time. ending: whether to give up waiting. Publishers of scalars keep their
    messages for late subscribers, which learn the type only from the publisher.
    """

    def __init__(
        self, node: Node, topics: Mapping[str, str], recorded_qos: Mapping[str, str], ending: Callable[[], bool]
    ) -> None:
        self._node, self._qos, self._ending = node, recorded_qos, ending
        self.publishers: dict[str, Publisher] = {}
        self.skipped: dict[str, str] = {}
        self.untimed: set[str] = set()
        self.overwritten = 0
        self._sent: dict[str, int] = {}  # of topics whose history is bounded
        self._confirmed: dict[str, int] = {}  # how many of these were acknowledged, or given up
        self._lagging: set[str] = set()  # topics whose subscribers have not acknowledged in time
        for topic, kind in topics.items():
            self._open(topic, kind)

    def make_room(self, topic: str) -> None:
        """Wait for subscribers, for a limited time, before a message would overwrite one that they have not got."""
        if topic not in self._sent:
            return
        publisher = self.publishers[topic]
        part = max(1, publisher.qos_profile.depth // PARTS)
        sent = self._sent[topic]
        if sent % part or sent == self._confirmed[topic]:
            return
        room = sent - self._confirmed[topic] + part <= publisher.qos_profile.depth
        if room and not _acknowledged(publisher):
            return
        # A subscriber that hangs must not delay the others again and again.
        deadline = time.monotonic() + (0.0 if topic in self._lagging else PATIENCE)
        while not _acknowledged(publisher) and not self._ending():
            if time.monotonic() >= deadline:
                self.overwritten += part
                self._confirmed[topic] += part
                self._lagging.add(topic)
                return
            time.sleep(POLL)
        self._confirmed[topic] = sent
        self._lagging.discard(topic)

    def publish(self, message: RawMessage) -> bool:
        """Publish a message; False if that failed."""
        try:
            self.publishers[message.topic].publish(message.data)
        except Exception as error:  # of the middleware: rclpy exports no class for it
            self._node.get_logger().error(
                f"{message.topic}: a message of {len(message.data)} bytes cannot be published ({error})",
                throttle_duration_sec=5.0,
            )
            return False
        if message.topic in self._sent:
            self._sent[message.topic] += 1
        return True

    def acknowledged(self) -> bool:
        """Whether all matched reliable subscribers have acknowledged everything."""
        return all(map(_acknowledged, self.publishers.values()))

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
        if list(fields.values())[:1] != ["std_msgs/Header"] and kind not in TF_TYPES:
            self.untimed.add(topic)
        try:
            publisher = self.publishers[topic] = self._publisher(topic, name, found, kept=kind in SCALAR_FIELDS)
        except InvalidTopicNameException as error:
            self.skipped[topic] = " ".join(str(error).split())
            return
        profile = publisher.qos_profile
        if profile.history == HistoryPolicy.KEEP_LAST and profile.reliability == ReliabilityPolicy.RELIABLE:
            self._sent[topic] = self._confirmed[topic] = 0

    def _publisher(self, topic: str, name: str, found: type, kept: bool) -> Publisher:
        profile = replay_profile(self._qos.get(topic, ""), kept)
        try:
            options = QoSOverridingOptions.with_default_policies()
            return self._node.create_publisher(found, name, profile, qos_overriding_options=options)
        except (InvalidQosOverridesError, ParameterException, RuntimeError, TypeError) as error:
            if of_rcl(error):  # not about an override
                raise
            raise PushPredictorError(f"qos_overrides.{topic}.publisher: {error}, give a QoS policy") from None


def check_filter(values: Mapping[str, Any]) -> None:
    """Raise RequestError for a parameter that is no regular expression."""
    for name in ("play.regex_to_filter", "play.exclude_regex_to_filter"):
        try:
            re.compile(values[name])
        except re.error as error:
            raise RequestError(name, values[name], f"a regular expression ({error})") from None


def is_played(topic: str, values: Mapping[str, Any]) -> bool:
    """Whether a topic is played: listed or matched (all, if there is no list and no expression), not excluded."""
    regex, names = values["play.regex_to_filter"], values["play.topics_to_filter"]
    excluded = values["play.exclude_regex_to_filter"]
    if listed(topic, values["play.exclude_topics_to_filter"]) or (excluded and re.fullmatch(excluded, topic)):
        return False
    return not (names or regex) or listed(topic, names) or bool(regex and re.fullmatch(regex, topic))


def listed(topic: str, names: Sequence[str]) -> bool:
    """Whether a topic is among names with or without the leading slash."""
    return topic.strip("/") in {name.strip("/") for name in names}


def _acknowledged(publisher: Publisher) -> bool:
    # With timeout 0: the call keeps the interpreter lock, so a wait in it would stop every thread.
    return bool(publisher.wait_for_all_acked(Duration(seconds=0)))
