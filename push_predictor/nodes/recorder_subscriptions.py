# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The subscriptions of a recorder: one for each topic, with the type and QoS of its publishers."""

from __future__ import annotations

from dataclasses import dataclass
from time import monotonic, time_ns

from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from push_predictor.errors import PushPredictorError
from push_predictor.nodes.polling import FollowingSubscription
from push_predictor.nodes.qos import common_profile
from push_predictor.online.live_recording import LiveRecording
from push_predictor.recordings.bag.metadata import TopicInfo
from push_predictor.recordings.decoder.sources import RecordedTopic

DEPTH = 5000  # the most that Fast DDS keeps: it rejects newer ones
LOOK = 0.1  # s between two looks at the publishers


@dataclass(eq=False)
class _Subscribed:
    topic: RecordedTopic
    reader: FollowingSubscription


class RecorderSubscriptions:
    """Moves messages into a recording, with the time at which they arrived, or that of /clock with use_sim_time."""

    def __init__(self, node: Node, recording: LiveRecording) -> None:
        self._node, self._recording = node, recording
        self._topics = [
            _Subscribed(topic, FollowingSubscription(node, topic.name, DEPTH)) for topic in recording.wanted
        ]
        self._looked = 0.0

    def look(self) -> None:
        """Subscribe to topics that have appeared. Call it often."""
        if monotonic() - self._looked < LOOK:
            return
        self._looked = monotonic()
        for subscribed in self._topics:
            self._recording.note(subscribed.topic.name, self._follow(subscribed))

    def drain(self) -> None:
        """Write the messages that have arrived since the last call, in order of arrival.

        Raises RecordingError if that fails.
        """
        if (now := self._simulated_time()) == 0:
            return  # the messages wait for the first time on /clock
        arrived: list[tuple[int, str, bytes, int]] = []
        for subscribed in self._topics:
            lost = subscribed.reader.lost
            for message in subscribed.reader.taken():
                at = now or message.received or time_ns()
                arrived.append((at, subscribed.topic.name, message.message, subscribed.reader.lost - lost))
                lost = subscribed.reader.lost
        for at, topic, data, missing in sorted(arrived, key=lambda message: message[0]):
            self._recording.write(topic, at, data, missing)

    def _follow(self, subscribed: _Subscribed) -> str:
        """Subscribe to a topic as it is published now; returns why that is not possible, '' if it is."""
        topic = subscribed.topic
        publishers = subscribed.reader.publishers()
        kinds = sorted({publisher.topic_type for publisher in publishers})
        known = self._recording.type_of(topic.name)
        self._recording.set_published(topic.name, bool(kinds))
        if not kinds:
            return ""
        if known and known not in kinds:
            return f"{topic.name} is now of type {kinds[0]}. Only its first type, {known}, is recorded."
        if not known and len(kinds) > 1:
            return f"{topic.name} has publishers of the types {' and '.join(kinds)}. One type is accepted."
        chosen = [publisher for publisher in publishers if publisher.topic_type == (known or kinds[0])]
        try:
            subscribed.reader.follow(known or kinds[0], chosen)
        except PushPredictorError as error:
            return f"{topic.name} is not recorded: {error}."
        if not known:
            self._recording.add_topic(_description(topic.name, chosen))
        return ""

    def _simulated_time(self) -> int | None:
        """The time on /clock in ns, 0 before the first, None without use_sim_time."""
        clock = self._node.get_clock()
        simulated = clock.clock_type == ClockType.ROS_TIME and clock.ros_time_is_active
        return int(clock.now().nanoseconds) if simulated else None


def _description(name: str, publishers: list[TopicEndpointInfo]) -> TopicInfo:
    profile = common_profile([publisher.qos_profile for publisher in publishers])
    return TopicInfo(
        name,
        publishers[0].topic_type,
        0,
        str(publishers[0].topic_type_hash),
        durability="transient_local" if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL else "volatile",
        reliability="reliable" if profile.reliability == ReliabilityPolicy.RELIABLE else "best_effort",
    )
