# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A replay waits for subscribers before it overwrites what they have not got, and not for ever."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

from push_predictor.nodes import replay_topics
from push_predictor.nodes.replay_topics import PARTS, PATIENCE, ReplayTopics
from push_predictor.recordings.bag.messages import RawMessage

TOPIC, OTHER = "/slider/pose", "/pusher/pose"
DEPTH = 1000


class Clock:
    """Time that passes only in a sleep."""

    def __init__(self) -> None:
        self.now = 0.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        self.now += duration


class Subscriber:
    """The publisher of a topic, whose only subscriber has got everything from a time on."""

    def __init__(self, clock: Clock, profile: QoSProfile, since: float = 0.0) -> None:
        self.qos_profile, self.clock, self.since = profile, clock, since

    def publish(self, data: bytes) -> None:
        """Take it."""

    def wait_for_all_acked(self, timeout: Any) -> bool:
        return self.clock.now >= self.since


def replay(clock: Clock, since: float, *, ending: bool = False, **profile: Any) -> ReplayTopics:
    """Two topics of which the first has a subscriber that is late; the second has got everything."""
    offered = QoSProfile(depth=DEPTH, **profile)
    made = {TOPIC: Subscriber(clock, offered, since), OTHER: Subscriber(clock, offered)}
    node = SimpleNamespace(create_publisher=lambda kind, name, *_, **__: made[f"/{name}"])
    types = dict.fromkeys(made, "geometry_msgs/msg/PoseStamped")
    return ReplayTopics(node, types, {}, lambda: ending)  # type: ignore[arg-type]  # fake


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    found = Clock()
    monkeypatch.setattr(replay_topics, "time", found)
    return found


def sent(publishers: ReplayTopics, topic: str, count: int) -> None:
    for _ in range(count):
        publishers.make_room(topic)
        publishers.make_room(topic)  # a message may be prepared more than once
        assert publishers.publish(RawMessage(topic, "", 0, b""))


def test_a_late_subscriber_is_waited_for_before_its_messages_are_overwritten(clock: Clock) -> None:
    publishers = replay(clock, since=0.4)
    sent(publishers, TOPIC, DEPTH)
    assert clock.now == 0.0
    sent(publishers, TOPIC, 1)
    assert clock.now == pytest.approx(0.4, abs=0.01) and publishers.overwritten == 0


def test_one_that_has_caught_up_in_between_is_not_waited_for(clock: Clock) -> None:
    publishers = replay(clock, since=0.4)
    sent(publishers, TOPIC, DEPTH // PARTS)
    clock.now = 0.5
    sent(publishers, TOPIC, DEPTH // PARTS)
    publishers.publishers[TOPIC].since = 9.0
    sent(publishers, TOPIC, DEPTH - DEPTH // PARTS)
    assert clock.now == 0.5


def test_one_that_hangs_is_waited_for_once_and_its_losses_are_counted(clock: Clock) -> None:
    publishers, lost = replay(clock, since=60.0), 2 * DEPTH // PARTS
    sent(publishers, TOPIC, DEPTH + 2 * DEPTH // PARTS)
    assert clock.now == pytest.approx(PATIENCE, abs=0.01) and publishers.overwritten == lost
    clock.now = 61.0
    sent(publishers, TOPIC, DEPTH // PARTS)
    publishers.publishers[TOPIC].since = 62.0  # it has caught up, and is late again
    sent(publishers, TOPIC, DEPTH)
    assert clock.now == pytest.approx(62.0, abs=0.01) and publishers.overwritten == lost


def test_the_other_topics_and_the_end_do_not_wait(clock: Clock) -> None:
    sent(replay(clock, since=60.0), OTHER, DEPTH)
    sent(replay(clock, since=60.0, ending=True), TOPIC, DEPTH)
    assert clock.now == 0.0


@pytest.mark.parametrize(
    "profile", [{"history": HistoryPolicy.KEEP_ALL}, {"reliability": ReliabilityPolicy.BEST_EFFORT}]
)
def test_what_overwrites_nothing_or_promises_nothing_waits_for_nobody(clock: Clock, profile: dict[str, Any]) -> None:
    sent(replay(clock, since=60.0, **profile), TOPIC, DEPTH)
    assert clock.now == 0.0
