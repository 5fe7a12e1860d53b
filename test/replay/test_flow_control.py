"""Back pressure of a replay: whom it waits for, and for how long. Publisher, subscriber and clock are made up."""

from __future__ import annotations

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
    """Passes only where somebody sleeps."""

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
    """With a subscriber who takes what waits `lag` s after it is asked. lost: overwritten before he had it."""

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
    made: Any = publisher  # has what is used of a Publisher
    return TopicSender(made, None, control or FlowControl(lambda: False))


def send(sender: TopicSender, clock: Clock, count: int, pause: float = 1e-4) -> None:
    for _ in range(count):
        sender.make_room()
        sender.send(MESSAGE)
        clock.now += pause


@pytest.mark.parametrize("depth", [1, 2, 3, 5, 7, 10, 100, 1000])
@pytest.mark.parametrize("lag", [0.0, 0.025, 2.0])
def test_a_fast_replay_overwrites_nothing_that_a_subscriber_lacks(clock: Clock, depth: int, lag: float):
    publisher = Publisher(clock, lag, depth)
    sender = sender_of(publisher)
    send(sender, clock, 20 * depth)
    assert publisher.lost == sender.overwritten == 0


@pytest.mark.parametrize("sent", range(0, DEPTH, 7))
def test_a_stall_of_the_machine_does_not_make_it_look_slow(clock: Clock, sent: int):
    publisher = Publisher(clock, lag=0.025)
    sender = sender_of(publisher)
    send(sender, clock, sent)
    clock.now += 3.0
    send(sender, clock, 20 * DEPTH)
    assert publisher.lost == sender.overwritten == 0


def test_a_slow_replay_waits_for_nobody(clock: Clock):
    publisher = Publisher(clock, lag=1e9)
    send(sender_of(publisher), clock, 5 * DEPTH, pause=0.02)
    assert clock.now == pytest.approx(5 * DEPTH * 0.02) and publisher.asked == 0


@pytest.mark.parametrize(
    "qos", [{"reliability": ReliabilityPolicy.BEST_EFFORT}, {"history": HistoryPolicy.KEEP_ALL, "depth": 0}]
)
def test_nobody_is_asked_where_nothing_is_kept_or_all(clock: Clock, qos: dict[str, Any]):
    publisher = Publisher(clock, lag=1e9, **qos)
    send(sender_of(publisher), clock, 5 * DEPTH)
    assert publisher.asked == 0


def test_after_hours_of_slow_replay_no_more_counts_as_lost_than_the_history_held(clock: Clock):
    publisher = Publisher(clock)
    sender = sender_of(publisher)
    for _ in range(900):
        send(sender, clock, DEPTH, pause=0.02)
        publisher.waiting = 0
    publisher.lag = 1e9
    send(sender, clock, 2 * DEPTH)
    assert publisher.lost <= sender.overwritten <= 3 * DEPTH


def test_one_that_hangs_holds_it_up_once_and_is_waited_for_again_when_it_runs(clock: Clock):
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


def test_control_is_spent_once_for_all_topics(clock: Clock):
    control = FlowControl(lambda: False)
    assert not control.wait("/slider/pose", lambda: False)
    assert not control.wait("/pusher/pose", lambda: False)
    assert clock.now == pytest.approx(FIRST_TIMEOUT + flow_control.RETRY_TIMEOUT, abs=0.01)
    assert control.wait("/slider/pose", lambda: True) and control.wait("/pusher/pose", lambda: True)
    assert not control.wait("/slider/pose", lambda: False)
    assert clock.now == pytest.approx(2.0 * FIRST_TIMEOUT + flow_control.RETRY_TIMEOUT, abs=0.02)


def test_the_end_of_the_replay_ends_the_wait(clock: Clock):
    assert not FlowControl(lambda: clock.now > 0.1).wait("/slider/pose", lambda: False)
    assert clock.now == pytest.approx(0.1, abs=0.01)
