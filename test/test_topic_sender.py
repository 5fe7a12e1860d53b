"""Back pressure of a replay: whom it waits for, and for how long. Publisher, subscriber and clock are made up."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.qos import HistoryPolicy, ReliabilityPolicy

from push_predictor.nodes import replay_topics
from push_predictor.nodes.replay_topics import TopicSender
from push_predictor.recordings.bag import RawMessage

DEPTH = 100
MESSAGE = RawMessage("/slider/pose", "geometry_msgs/msg/PoseStamped", 0, b"")


class Subscriber:
    """A history of DEPTH messages and one who takes them; time passes where he is waited for.

    lost: overwritten before he had them. answers: does he run?
    """

    def __init__(self, answers: bool = True) -> None:
        self.answers, self.time = answers, 0.0
        self.waiting = self.lost = 0
        self.qos_profile = SimpleNamespace(
            history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE, depth=DEPTH
        )

    def publish(self, data: bytes) -> None:
        self.waiting += 1
        self.lost += self.waiting > DEPTH

    def wait_for_all_acked(self, timeout: Any) -> bool:
        if self.answers:
            self.waiting = 0
        return self.answers

    def monotonic(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self.time += seconds


@pytest.fixture
def subscriber(monkeypatch: pytest.MonkeyPatch) -> Subscriber:
    made = Subscriber()
    monkeypatch.setattr(replay_topics, "time", made)
    return made


def send(sender: TopicSender, subscriber: Subscriber, count: int, pause: float = 1e-4) -> None:
    for _ in range(count):
        sender.send(MESSAGE)
        subscriber.time += pause


def test_a_fast_replay_overwrites_nothing_that_a_subscriber_lacks(subscriber: Subscriber):
    sender = TopicSender(subscriber, None)  # type: ignore[arg-type]  # has what is used of a Publisher
    send(sender, subscriber, 20 * DEPTH)
    assert subscriber.lost == sender.overwritten == 0


@pytest.mark.parametrize("sent", range(0, DEPTH, 7))
def test_a_stall_of_the_machine_does_not_make_it_look_slow(subscriber: Subscriber, sent: int):
    sender = TopicSender(subscriber, None)  # type: ignore[arg-type]
    send(sender, subscriber, sent)
    subscriber.time += 3.0
    send(sender, subscriber, 20 * DEPTH)
    assert subscriber.lost == sender.overwritten == 0


def test_a_slow_replay_waits_for_nobody(subscriber: Subscriber):
    sender, subscriber.answers = TopicSender(subscriber, None), False  # type: ignore[arg-type]
    send(sender, subscriber, 5 * DEPTH, pause=0.02)
    assert subscriber.time == pytest.approx(5 * DEPTH * 0.02)


def test_one_that_hangs_holds_it_up_once_and_is_waited_for_again_when_it_runs(subscriber: Subscriber):
    sender, subscriber.answers = TopicSender(subscriber, None), False  # type: ignore[arg-type]
    send(sender, subscriber, 20 * DEPTH)
    assert 5.0 < subscriber.time < 8.0
    assert sender.overwritten >= subscriber.lost > 0
    subscriber.answers = True
    send(sender, subscriber, DEPTH)
    counted, lost = sender.overwritten, subscriber.lost
    send(sender, subscriber, 20 * DEPTH)
    assert (sender.overwritten, subscriber.lost) == (counted, lost)
