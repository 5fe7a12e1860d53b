# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Flow control of a replay: which subscribers it waits for, and for how long. Publisher and clock are fakes."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.qos import HistoryPolicy, ReliabilityPolicy

from push_predictor.nodes.replay import topic_sender
from push_predictor.nodes.replay.topic_sender import TopicSender
from push_predictor.recordings.bag.reader import RawMessage
from push_predictor.replay import flow_control
from push_predictor.replay.flow_control import FIRST_TIMEOUT, FlowControl

DEPTH = 100
MESSAGE = RawMessage("/slider/pose", "geometry_msgs/msg/PoseStamped", 0, b"")


class Clock:
    """A clock that advances only during sleeps."""

    def __init__(self) -> None:
        self.now = 0.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    for module in (topic_sender, flow_control):
        monkeypatch.setattr(module, "time", made)
    return made


class Publisher:
    """A publisher whose subscriber acknowledges `lag` s after a request. lost: messages overwritten before that."""

    def __init__(self, clock: Clock, lag: float = 0.0, depth: int = DEPTH, **qos: Any) -> None:
        policies = {"history": HistoryPolicy.KEEP_LAST, "reliability": ReliabilityPolicy.RELIABLE, "depth": depth}
        self.qos_profile, self.topic_name = SimpleNamespace(**{**policies, **qos}), "/slider/pose"
        self.clock, self.lag = clock, lag
        self.waiting = self.lost = self.asked = 0
        self._asked_at: float | None = None

    def publish(self, data: bytes) -> None:
        self.waiting += 1
        self.lost += self.waiting > self.qos_profile.depth
        self._asked_at = None

    def wait_for_all_acked(self, timeout: Any) -> bool:
        self.asked += 1
        self._asked_at = self.clock.now if self._asked_at is None else self._asked_at
        if done := self.clock.now - self._asked_at >= self.lag:
            self.waiting = 0
        return done


def sender_of(publisher: Publisher, control: FlowControl | None = None) -> TopicSender:
    made: Any = publisher  # has the used part of a Publisher
    return TopicSender(made, None, control or FlowControl(lambda: False))


def send(sender: TopicSender, clock: Clock, count: int, pause: float = 1e-4) -> None:
    for _ in range(count):
        sender.make_room()
        sender.send(MESSAGE)
        clock.now += pause


@pytest.mark.parametrize(("depth", "lag"), [*product([1, 2, 3, 5, 7, 10, 100, 1000], [0.0, 0.025]), (1, 2.0), (7, 2.0)])
def test_fast_replay_overwrites_no_unreceived_message(clock: Clock, depth: int, lag: float):
    publisher = Publisher(clock, lag, depth)
    sender = sender_of(publisher)
    send(sender, clock, 20 * depth)
    assert publisher.lost == sender.overwritten == 0


@pytest.mark.parametrize("sent", range(0, DEPTH, 7))
def test_stall_of_the_machine_does_not_look_like_a_slow_replay(clock: Clock, sent: int):
    publisher = Publisher(clock, lag=0.025)
    sender = sender_of(publisher)
    send(sender, clock, sent)
    clock.now += 3.0
    send(sender, clock, 20 * DEPTH)
    assert publisher.lost == sender.overwritten == 0


def test_slow_replay_never_waits(clock: Clock):
    publisher = Publisher(clock, lag=1e9)
    send(sender_of(publisher), clock, 5 * DEPTH, pause=0.02)
    assert clock.now == pytest.approx(5 * DEPTH * 0.02) and publisher.asked == 0


@pytest.mark.parametrize(
    "qos", [{"reliability": ReliabilityPolicy.BEST_EFFORT}, {"history": HistoryPolicy.KEEP_ALL, "depth": 0}]
)
def test_no_wait_for_best_effort_or_keep_all(clock: Clock, qos: dict[str, Any]):
    publisher = Publisher(clock, lag=1e9, **qos)
    send(sender_of(publisher), clock, 5 * DEPTH)
    assert publisher.asked == 0


def test_lost_count_is_bounded_by_the_history_after_a_long_slow_replay(clock: Clock):
    publisher = Publisher(clock)
    sender = sender_of(publisher)
    for _ in range(900):
        send(sender, clock, DEPTH, pause=0.02)
        publisher.waiting = 0
    publisher.lag = 1e9
    send(sender, clock, 2 * DEPTH)
    assert publisher.lost <= sender.overwritten <= 3 * DEPTH


def test_hanging_subscriber_delays_the_replay_once_and_is_waited_for_after_recovery(clock: Clock):
    publisher = Publisher(clock, lag=1e9)
    sender = sender_of(publisher)
    send(sender, clock, 1000 * DEPTH)
    passed = 1000 * DEPTH * 1e-4
    assert FIRST_TIMEOUT < clock.now - passed < FIRST_TIMEOUT + 0.3 * passed
    assert sender.overwritten >= publisher.lost > 0
    publisher.lag = 0.025
    send(sender, clock, 200 * DEPTH)
    counted, lost = sender.overwritten, publisher.lost
    send(sender, clock, 20 * DEPTH)
    assert (sender.overwritten, publisher.lost) == (counted, lost)


def test_first_timeout_applies_once_for_all_topics(clock: Clock):
    control = FlowControl(lambda: False)
    assert not control.wait("/slider/pose", lambda: False)
    assert not control.wait("/pusher/pose", lambda: False)
    assert clock.now == pytest.approx(FIRST_TIMEOUT + flow_control.RETRY_TIMEOUT, abs=0.01)
    assert control.wait("/slider/pose", lambda: True) and control.wait("/pusher/pose", lambda: True)
    assert not control.wait("/slider/pose", lambda: False)
    assert clock.now == pytest.approx(2.0 * FIRST_TIMEOUT + flow_control.RETRY_TIMEOUT, abs=0.02)


def test_end_of_the_replay_ends_the_wait(clock: Clock):
    assert not FlowControl(lambda: clock.now > 0.1).wait("/slider/pose", lambda: False)
    assert clock.now == pytest.approx(0.1, abs=0.01)
