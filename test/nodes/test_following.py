# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A subscription that follows its publishers: which messages it counts as lost, and which types it refuses."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")
from rclpy.impl.implementation_singleton import rclpy_implementation

from push_predictor.errors import PushPredictorError
from push_predictor.nodes import polling
from push_predictor.nodes.polling import FollowingSubscription, Taken
from push_predictor.nodes.validator import live_streams
from push_predictor.nodes.validator.live_streams import TransformTopics
from push_predictor.recordings.decoder.transform_buffer import TransformBuffer


class Topic:
    """A topic without a middleware, and the subscription to it. Each call of `send` takes one nanosecond."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.publishers, self._now = 1, 0
        self._waiting: list[Taken] = []
        node: Any = SimpleNamespace(
            resolve_topic_name=str,
            get_publishers_info_by_topic=lambda _: [SimpleNamespace(topic_type="of another type")] * self.publishers,
            count_publishers=lambda _: self.publishers,
        )
        monkeypatch.setattr(polling, "take_all", self._take_all)
        monkeypatch.setattr(polling, "time_ns", lambda: self._now)
        self.subscription = FollowingSubscription(node, "/slider/pose", str)
        self.subscription._subscription = node

    def _take_all(self, _: object) -> list[Taken]:
        taken, self._waiting = self._waiting, []
        return taken

    def send(self, *numbers: int) -> None:
        """Messages with these numbers arrive."""
        for number in numbers:
            self._now += 1
            self._waiting.append(Taken(b"", number, self._now, self._now))

    def look(self, publishers: int) -> None:
        """The node looks at the publishers, of which there are this many."""
        self._now += 1
        self.publishers = publishers
        self.subscription.look()

    def lost(self) -> int:
        list(self.subscription.taken())
        return self.subscription.lost


@pytest.fixture
def topic(monkeypatch: pytest.MonkeyPatch) -> Topic:
    found = Topic(monkeypatch)
    found.look(1)
    return found


Step = int | tuple[int, ...] | str  # the publishers at a look; numbers of messages; publishers between two looks


@pytest.mark.parametrize(
    ("steps", "lost"),
    [
        ([(7, 8, 11, 12), 1, (14,)], 3),  # also from one look to the next
        ([(7, 8), (3, 4)], 0),  # a publisher that begins anew
        ([2, (7, 90, 8, 91, 200)], 0),  # two number their messages independently
        ([2, (7, 8, 3), 1, (9, 10), (13,)], 2),  # one has left: the one that stays is counted again
        ([2, "wait", (7, 3), 1, "take", (200, 201, 203)], 1),  # messages of the one that has left may still wait
        ([2, "wait", (7, 3), "1", (200,), "take"], 0),  # it leaves between two looks
        (["wait", (7,), "2", (200,), "take"], 0),  # another one comes between two looks
    ],
)
def test_missing_numbers_are_lost_messages_if_they_are_of_one_publisher(
    topic: Topic, steps: list[Step], lost: int
) -> None:
    waits = False
    for step in steps:
        if isinstance(step, tuple):
            topic.send(*step)
        elif isinstance(step, int):
            topic.look(step)
        elif step in ("wait", "take"):
            waits = step == "wait"
        else:
            topic.publishers = int(step)
        if not waits:
            topic.lost()
    assert topic.lost() == lost


def test_a_topic_was_heard_with_its_last_message_or_publisher(topic: Topic, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [10.0]
    monkeypatch.setattr(polling, "monotonic", lambda: now[0])
    topic.look(0)
    now[0] = 20.0
    topic.look(1)
    now[0] = 30.0
    topic.look(1)
    assert topic.subscription.heard == 20.0, "when its publisher came"
    topic.send(1)
    assert topic.lost() == 0 and topic.subscription.heard == 30.0


def test_a_subscription_that_rcl_refuses_is_tried_again_and_no_other_error_is_hidden() -> None:
    """As while another stream of the node still has a subscription of another type."""
    outcomes: list[Any] = [rclpy_implementation.RCLError("incompatible type"), RuntimeError("a bug"), SimpleNamespace()]

    def create(*_: object, **__: object) -> Any:
        if isinstance(outcome := outcomes.pop(0), Exception):
            raise outcome
        return outcome

    node: Any = SimpleNamespace(
        resolve_topic_name=str, create_subscription=create, get_publishers_info_by_topic=lambda _: []
    )
    subscription = FollowingSubscription(node, "/slider/pose", lambda kind: "", first="geometry_msgs/msg/PoseStamped")
    subscription.look()
    with pytest.raises(RuntimeError, match="a bug"):
        subscription.look()
    subscription.look()
    subscription.look()
    assert not outcomes, "once it exists, it is kept"


def test_tf_without_its_message_package_is_refused_with_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def not_installed(kind: str) -> type:
        raise PushPredictorError(f"type {kind} is not installed (No module named 'tf2_msgs')")

    monkeypatch.setattr(live_streams, "message_class", not_installed)
    monkeypatch.setattr(polling, "_overriding", lambda *_: None)
    node: Any = SimpleNamespace(resolve_topic_name=str, get_publishers_info_by_topic=lambda _: [])
    topics = TransformTopics(node, "/tf", TransformBuffer([]))
    topics.look()
    assert topics.problem == topics.refusal and "install ros-jazzy-tf2-msgs" in topics.problem
