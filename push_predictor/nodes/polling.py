# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Polled topics and services: a node takes what has arrived itself, at a tenth of the cost of an executor's turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from time import monotonic, time_ns
from typing import Any, NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.qos import QoSPolicyKind, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.validate_topic_name import validate_topic_name

from push_predictor.errors import PushPredictorError, RequestError
from push_predictor.nodes.parameters import given_value
from push_predictor.nodes.qos import common_profile, message_class
from push_predictor.nodes.runtime import of_rcl
from push_predictor.recordings.decoder.decoder import name_of
from push_predictor.recordings.decoder.sources import COVARIATE, sources_of
from push_predictor.recordings.topics import Topics

ONE_TYPE = "One type of publishers is accepted."


class NoExecutor(CallbackGroup):
    """Entities that no executor waits for."""

    def can_execute(self, entity: Any) -> bool:
        """See CallbackGroup."""
        return False

    def beginning_execution(self, entity: Any) -> bool:
        """See CallbackGroup."""
        return False

    def ending_execution(self, entity: Any) -> None:
        """Do nothing: execution never begins."""


def not_called(*_: object) -> None:
    """The callback that such an entity must have; the node takes its messages or requests itself."""


class Taken(NamedTuple):
    """A message, its number (counted by the publisher), and when it was sent and received (ns)."""

    message: Any
    number: int
    sent: int
    received: int


def take_all(subscription: Subscription) -> Iterator[Taken]:
    """The messages that the middleware holds for a subscription."""
    with subscription.handle:  # as rclpy.wait_for_message does it; an executor's turn a message costs ten times as much
        while (taken := subscription.handle.take_message(subscription.msg_type, subscription.raw)) is not None:
            message, info = taken
            number, sent = info["publication_sequence_number"], info["source_timestamp"]
            yield Taken(message, number, sent, info["received_timestamp"])


def take_request(service: Service) -> tuple[Any, Any]:
    """The next request of a service, and the header to answer it by; None and None if there is none."""
    with service.handle:
        request, header = service.handle.service_take_request(service.srv_type.Request)
    return request, header


class FollowingSubscription:
    """A subscription to the one type of a topic's publishers that fits, made again when their type or QoS changes.

    It takes serialized messages, with the reliability that all these publishers offer.
    unfit: called with a type, returns why it does not fit, '' if it does. first: the type to subscribe to before there
    is a publisher, '' for none. live: parameters qos_overrides.TOPIC.subscription.* apply, and a reliability given
    there is kept; else it also takes what was sent before, if all publishers keep it.
    Call `look` in the executor's thread, `taken` before it, and one method at a time.

    name: of the topic after remapping. offered: the publishers, of any type, at the last look. problem: why they cannot
    be subscribed to, '' if they can. kind: the type of the subscription, '' without one. heard: when the last message
    came, or the last publisher. lost: messages that were overwritten before they were taken, or sent while the
    subscription was made again.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        unfit: Callable[[str], str],
        *,
        first: str = "",
        live: bool = False,
    ) -> None:
        self._node, self._topic, self._group = node, topic, NoExecutor()
        self._unfit, self._first, self._live = unfit, first, live
        self.name = node.resolve_topic_name(topic)
        self.offered: list[TopicEndpointInfo] = []
        self.problem = ""
        self.heard = monotonic()
        self.lost = 0
        self._overriding = _overriding(node, self.name) if live else None
        self._subscription: Subscription | None = None
        self._profile: tuple[Any, ...] = ("",)
        self._last: int | None = None  # number of the last message
        self._alone = True  # whether there was at most one publisher at the last look
        self._since = 0  # when their number changed, ns

    @property
    def kind(self) -> str:
        """See the class."""
        return str(self._profile[0])

    @property
    def kinds(self) -> list[str]:
        """The types of the publishers."""
        return sorted({publisher.topic_type for publisher in self.offered})

    @property
    def reliability(self) -> ReliabilityPolicy | None:
        """That of the subscription, None without one."""
        return self._subscription.qos_profile.reliability if self._subscription is not None else None

    def look(self) -> None:
        """Subscribe as the present publishers offer the topic; stay subscribed when they have left."""
        if not self.offered:
            self.heard = monotonic()
        self.offered = self._node.get_publishers_info_by_topic(self._topic)
        if (alone := len(self.offered) <= 1) != self._alone:
            self._alone, self._last, self._since = alone, None, time_ns()
        kinds = self.kinds or ([self._first] if self._first and not self.kind else [])
        unfit = {kind: self._unfit(kind) for kind in kinds}
        fitting = [kind for kind, why in unfit.items() if not why]
        if len(fitting) == 1:
            self.problem = self._follow(fitting[0], [each for each in self.offered if each.topic_type == fitting[0]])
        else:
            self.problem = next(filter(None, unfit.values()), ONE_TYPE if unfit else "")

    def _follow(self, kind: str, publishers: Sequence[TopicEndpointInfo]) -> str:
        """Subscribe to a type as these publishers offer it, reliable without any; returns why it is not possible."""
        offered = [publisher.qos_profile for publisher in publishers]
        profile = common_profile(offered, earlier=not self._live)
        wanted = kind, profile.durability, profile.reliability
        if wanted == self._profile:
            return ""
        try:
            found = message_class(kind)
        except PushPredictorError as error:
            return f"{error}."
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription, self._profile = None, ("",)
        try:
            self._subscription = self._node.create_subscription(
                found,
                self._topic,
                not_called,
                profile,
                callback_group=self._group,
                qos_overriding_options=self._overriding,
                raw=True,
            )
        except RuntimeError as error:
            if not of_rcl(error):
                raise
            return ""  # another stream still has one of another type. Try again at the next look
        self._profile = wanted
        return ""

    def taken(self) -> Iterator[Taken]:
        """The arrived messages."""
        if self._subscription is None:
            return
        for message in take_all(self._subscription):
            self.heard = monotonic()
            self._note_loss(message)
            yield message

    def _note_loss(self, message: Taken) -> None:
        """Count the messages that are missing between two; several publishers number theirs independently."""
        if 0 < message.received <= self._since:  # perhaps of one that has left
            return
        number = message.number
        last, self._last = self._last, number
        if last is not None and number > last + 1 and self._alone and self._node.count_publishers(self.name) == 1:
            self.lost += number - last - 1


def check_sources(topics: Topics) -> None:
    """Raise RequestError that names the parameter, its value and what is accepted, for names that are not valid."""
    scalars: set[str] = set()
    for name, source in sources_of(topics):
        frame = ", or a frame as in /tf:tool0" if name not in ("wrench", COVARIATE) else ""
        accepted = f"a topic, or a topic and a field as in /odom.pose.pose{frame}"
        try:
            validate_topic_name(source.topic)
        except InvalidTopicNameException as error:
            raise RequestError(source.key, source.text, f"{accepted} ({' '.join(str(error).split())})") from None
        if source.topic.startswith("~") or source.text.endswith(".") or not source.frame_fits(bool(frame)):
            raise RequestError(source.key, source.text, accepted)
        if name == COVARIATE and name_of(source) in scalars:
            raise RequestError(source.key, source.text, "each topic or field once")
        scalars |= {name_of(source)} if name == COVARIATE else set()


def _overriding(node: Node, name: str) -> QoSOverridingOptions:
    """History and depth may be overridden; reliability is fixed only if a parameter gives it."""
    policies = [QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH]
    if given_value(node, f"qos_overrides.{name}.subscription.reliability") is not None:
        policies.append(QoSPolicyKind.RELIABILITY)
    return QoSOverridingOptions(policies)
