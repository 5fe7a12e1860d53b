# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The validator's sensor topics: subscriptions follow type and reliability of the publishers."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from time import time_ns
from types import SimpleNamespace
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped, PoseWithCovariance, TransformStamped, WrenchStamped
from nav_msgs.msg import Odometry
from planar_messages import pose_message
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_harness import free_domain, ros_context, wait_until
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker

from msg_adapters import ns_to_stamp
from push_predictor.errors import RequestError
from push_predictor.nodes.polling import check_sources
from push_predictor.nodes.validator import sensor_subscriber
from push_predictor.nodes.validator.sensor_subscriber import SensorSubscriber
from push_predictor.recordings.topics import Topics

pytestmark = pytest.mark.slow

SECOND = 10**9
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
RELIABLE = QoSProfile(depth=10)


@pytest.fixture
def domain() -> int:
    return free_domain()


@pytest.fixture
def listener(domain: int) -> Iterator[Node]:
    with ros_context(domain, namespace="cell") as node:
        yield node


@pytest.fixture
def talker(domain: int) -> Iterator[Node]:
    with ros_context(domain, namespace="cell") as node:
        yield node


@contextmanager
def subscriber(node: Node, *arguments: Any) -> Iterator[SensorSubscriber]:
    sensors = SensorSubscriber(node, *arguments)
    try:
        yield sensors
    finally:
        sensors.close()


@contextmanager
def offered(node: Node, topic: str, profile: QoSProfile, kind: type = PoseStamped) -> Iterator[Publisher]:
    """A publisher that is destroyed at once on leaving; an executor waiting for its events would delay that."""
    silent = PublisherEventCallbacks(use_default_callbacks=False)
    publisher = node.create_publisher(kind, topic, profile, event_callbacks=silent)
    yield publisher
    node.destroy_publisher(publisher)


def received(
    sensors: SensorSubscriber,
    publisher: Publisher,
    make: Callable[[int], Any],
    stream: str = "slider",
    expected: Callable[[Any], bool] = lambda _: True,
) -> Any:
    """Publish, one message a turn, until one of them is received; returns what was taken of the stream last.

    expected: tells it from what an earlier publisher has sent and what arrives only now.
    """
    sensors.take()
    turns = iter(range(10**9))
    taken: list[Any] = []

    def arrived() -> bool:
        publisher.publish(make(next(turns)))
        sensors.look()
        taken.append(getattr(sensors.take(), stream))
        return len(taken[-1]) > 0 and expected(taken[-1])

    assert wait_until(arrived), "no message was received"
    return taken[-1]


def pose_at(k: int) -> PoseStamped:
    return pose_message(SECOND + k, 0.1, -0.2, 0.0, 0.5)


def reliabilities(node: Node, topic: str) -> list[ReliabilityPolicy]:
    return [info.qos_profile.reliability for info in node.get_subscriptions_info_by_topic(topic)]


def test_best_effort_publishers_are_heard_and_reliable_ones_stay_reliable(listener: Node, talker: Node) -> None:
    topic = "/cell/slider/pose"
    with subscriber(listener, Topics()) as sensors:
        assert wait_until(lambda: reliabilities(talker, topic) == [ReliabilityPolicy.RELIABLE]), "before any publisher"
        with offered(talker, topic, BEST_EFFORT) as lossy:
            assert received(sensors, lossy, pose_at).x[0] == 0.1
            with offered(talker, topic, RELIABLE) as sure:
                assert received(sensors, sure, pose_at).y[0] == -0.2
                assert reliabilities(talker, topic) == [ReliabilityPolicy.BEST_EFFORT], "what both publishers offer"
        with offered(talker, topic, RELIABLE) as sure:
            received(sensors, sure, pose_at)

            def reliable() -> bool:
                sensors.look()
                return reliabilities(talker, topic) == [ReliabilityPolicy.RELIABLE]

            assert wait_until(reliable)


def transform_at(k: int) -> TransformStamped:
    message = TransformStamped()
    message.header.stamp, message.header.frame_id = ns_to_stamp(SECOND + k), "world"
    message.transform.translation.x, message.transform.rotation.w = 0.3, 1.0
    return message


def odometry_at(k: int) -> Odometry:
    message = Odometry()
    message.header.stamp, message.header.frame_id = ns_to_stamp(SECOND + k), "world"
    message.pose.pose.position.y, message.pose.pose.orientation.w = 0.4, 1.0
    return message


def marker_at(k: int) -> Marker:
    message = Marker(pose=pose_at(k).pose)
    message.header = pose_at(k).header
    return message


def test_the_type_is_that_of_the_publishers_or_a_named_field_of_it(listener: Node, talker: Node) -> None:
    topics = Topics("/vicon/block", "tip.pose", "ft/sensor")
    with subscriber(listener, topics) as sensors:
        with offered(talker, "/vicon/block", BEST_EFFORT, TransformStamped) as tracker:
            stream = received(sensors, tracker, transform_at)
            assert (stream.x[0], stream.stamp[0] // SECOND) == (0.3, 1)
        with offered(talker, "/vicon/block", RELIABLE, Odometry) as tracker:
            received(sensors, tracker, odometry_at, expected=lambda stream: stream.y[-1] == 0.4)  # from now on
        with offered(talker, "tip", RELIABLE, Marker) as robot:
            assert received(sensors, robot, marker_at, "pusher").x[0] == 0.1
        with offered(talker, "tip", RELIABLE, PoseWithCovariance) as robot:
            begin = time_ns()
            undated = partial(received, sensors, robot, lambda k: PoseWithCovariance(pose=pose_at(k).pose), "pusher")
            stream = undated(lambda stream: stream.stamp[-1] >= begin)  # dated by its sending
            assert stream.x[-1] == 0.1 and stream.stamp[-1] <= time_ns()

        def gone() -> bool:
            sensors.look()
            sensors.inspect()
            return "/cell/tip.pose: No publisher." in sensors.problems()

        assert wait_until(gone), "the name after remapping"
        assert not any("/cell/ft/sensor" in text for text in sensors.problems()), "the wrench is optional"
        wrench = "wrench: /cell/ft/sensor, geometry_msgs/msg/WrenchStamped, reliable. No publisher: contact is found"
        assert str(sensors.figures()["wrench topic"]).startswith(wrench)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (
            JointState,
            "/cell/slider/pose: slider_topic 'slider/pose': slider/pose is of type 'sensor_msgs/msg/JointState'",
        ),
        (Marker, "give one of its fields: slider/pose.pose"),
    ],
)
def test_a_type_without_a_pose_is_refused_by_name(listener: Node, talker: Node, kind: type, words: str) -> None:
    with subscriber(listener, Topics()) as sensors, offered(talker, "slider/pose", RELIABLE, kind):

        def refused() -> bool:
            sensors.look()
            sensors.inspect()
            return sensors.refused

        assert wait_until(refused)
        (problem,) = [text for text in sensors.problems() if "slider" in text]
        assert words in problem


def test_another_frame_is_named_without_a_given_world(listener: Node, talker: Node) -> None:
    def elsewhere() -> PoseStamped:
        message = pose_at(0)
        message.header.frame_id = "table"
        return message

    with subscriber(listener, Topics()) as sensors, offered(talker, "slider/pose", RELIABLE) as tracker:

        def other_frame() -> bool:
            tracker.publish(elsewhere())
            sensors.look()
            sensors.inspect()
            return any("frame_id 'table' is not accepted, give 'world', or set world" in t for t in sensors.problems())

        assert wait_until(other_frame)
        sensors.take()
        assert sensors.decoder.of("slider").rejected["frame_id"] > 0


def test_a_given_world_takes_its_own_frame_and_waits_for_transforms_of_others(listener: Node, talker: Node) -> None:
    topics = Topics(world="table")
    with subscriber(listener, topics) as sensors, offered(talker, "slider/pose", RELIABLE) as tracker:

        def turned(frame: str) -> Callable[[int], PoseStamped]:
            def message(k: int) -> PoseStamped:
                made = pose_message(SECOND + k * SECOND // 10, 0.1, -0.2, 0.0, 0.5)
                made.header.frame_id = frame
                return made

            return message

        assert received(sensors, tracker, turned("table")).x[0] == 0.1
        assert sensors.world == "table"
        turns = iter(range(1000, 10**9))

        def rejected() -> bool:
            tracker.publish(turned("vicon")(next(turns)))
            sensors.look()
            sensors.take()
            return sensors.decoder.of("slider").rejected["without transform"] > 0

        assert wait_until(rejected), "after two seconds of stamps"
        sensors.inspect()
        assert any("in frame 'vicon', and there is no /tf from there to 'table'" in t for t in sensors.problems())


def test_no_sample_is_lost_when_one_of_two_publishers_leaves(listener: Node, talker: Node) -> None:
    with subscriber(listener, Topics()) as sensors, offered(talker, "slider/pose", RELIABLE) as stays:
        received(sensors, stays, pose_at)
        with offered(talker, "slider/pose", RELIABLE) as leaves:
            for k in range(40):  # its numbers are far ahead of those of the other
                leaves.publish(pose_at(k))
            received(sensors, leaves, pose_at)

        def alone() -> bool:
            sensors.look()
            return talker.count_publishers("slider/pose") == 1

        assert wait_until(alone)
        for _ in range(3):
            received(sensors, stays, pose_at)
        received(sensors, stays, pose_at)
        assert "slider lost" not in sensors.figures()
        assert not any("were lost" in text for text in sensors.problems())


@pytest.mark.parametrize(
    ("topics", "named"),
    [
        (Topics(slider="1 pose"), "slider_topic: '1 pose'"),
        (Topics(pusher="~/pose"), "pusher_topic: '~/pose'"),
        (Topics(pusher="/"), "pusher_topic: '/'"),
        (Topics(wrench="/tf:tool0"), "wrench_topic: '/tf:tool0'"),
        (Topics(slider="/tf:"), "slider_topic: '/tf:'"),
        *((Topics(covariates=(name,)), f"covariate_topics: '{name}'") for name in ("~/x", "1 x", "/tf:x", "x.", ".x")),
        (Topics(covariates=("x", "/x")), "covariate_topics: '/x'"),
    ],
)
def test_rejects_what_is_no_source(topics: Topics, named: str) -> None:
    with pytest.raises(RequestError, match="is not accepted, give") as raised:
        check_sources(topics)
    assert str(raised.value).startswith(named)


def test_tf_without_its_package_is_refused_by_name(
    listener: Node, talker: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("tf2_msgs", "tf2_msgs.msg"):
        monkeypatch.setitem(sys.modules, name, None)
    with subscriber(listener, Topics(slider="/tf:block", pusher="/tf:tool0")) as sensors:
        assert sensors._tf["tf"].buffer.world == "", "the root of the tree"
    with subscriber(listener, Topics(pusher="/tf:tool0")) as sensors:
        assert sensors._tf["tf"].buffer.world == sensors.world == "world", "as the headers of the slider"
        sensors.inspect()
        assert sensors.refused and any("/tf:tool0: type tf2_msgs/msg/TFMessage is not" in t for t in sensors.problems())
    topics = Topics(wrench_frame="ft", wrench_bias="free_motion")
    with subscriber(listener, topics) as sensors, offered(talker, "pusher/wrench", RELIABLE, WrenchStamped):

        def refused() -> bool:
            sensors.look()
            sensors.inspect()
            return sensors.refused

        assert wait_until(refused) and "type tf2_msgs/msg/TFMessage is not" in str(sensors.figures()["wrench topic"])
        assert sensors.world == "world" and not sensors.waits_for_bias
        assert sensors.figures()["wrench bias"] == "not known yet: too few samples"


def test_samples_are_complete_when_every_topic_has_messages_or_after_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(sensor_subscriber, "monotonic", lambda: now[0])
    slider: list[bytes] = []
    wrench: list[bytes] = []
    decoder = SimpleNamespace(poses={"slider": slider}, wrench=SimpleNamespace(messages=wrench))
    sensors: Any = SimpleNamespace(decoder=decoder, _empty=0.0, _settled=True, _scalars=[])
    complete = SensorSubscriber.complete
    assert not complete(sensors), "no message yet"
    slider.append(b"pose")
    now[0] += 0.9
    assert not complete(sensors)
    now[0] += 0.2
    assert complete(sensors), "no wrench for a second"
    wrench.append(b"force")
    sensors._empty = now[0]
    assert complete(sensors), "messages of every topic"
    sensors._settled = False
    assert not complete(sensors), "the root of the tree may not be known yet"
    now[0] += 1.1
    assert complete(sensors)
