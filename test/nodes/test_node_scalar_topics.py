# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Scalar topics through real nodes: a replay gives the same values online as reading the recording."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hosted_nodes import hosted_node
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from replay_bags import WRENCH, stamped, write_bag
from ros_harness import free_domain, ros_context, wait_until
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Float32, Float64, String
from validator_bench import WRITTEN, Status, assert_same_as_offline, hosting_replay, hosting_validator

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import train_model
from push_predictor.nodes.validator.scalar_topics import ClockTopic, ScalarTopic
from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.recordings.decoder.decoder import StreamDecoder
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.streams import ScalarStream
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.write import write_recording
from push_predictor.simulation.rig_simulator import Sensors, SimulationSpec, random_pushes, simulate

pytestmark = pytest.mark.slow

WARMTH, ROD, HUMIDITY, NAME = "/surface/warmth", "/rod/temperature", "/room/humidity", "/rod/name"
OURS = (WARMTH, ROD, HUMIDITY)
FIELD = "/fan/load.wrench.torque.y"  # of a type that is no scalar's
ASKED = ["surface/warmth", "/rod/temperature", "room/humidity", "rod/name", "nowhere", "fan/load.wrench.torque.y"]
SECOND = 10**9


def float32(value: float) -> bytes:
    return b"\0\1\0\0" + struct.pack("<f", value)


def float64(value: float) -> bytes:
    return b"\0\1\0\0" + struct.pack("<d", value)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pushes with a scalar that jumps ten times a second, one that starts late and has a stamp, and a rare one."""
    folder, rng = tmp_path_factory.mktemp("scalars"), np.random.default_rng(0)
    plan = random_pushes(8, [0.03], 0.02, rng)
    few = Sensors(rate=50.0, wrench_rate=50.0)  # samples, which the nodes receive one by one
    write_recording(folder / "pushes", simulate(SimulationSpec("rect1", "abs", plan, name="pushes", sensors=few)))
    bag = open_bag(folder / "pushes")
    messages = [
        (m.topic, m.type, m.log_time, m.data) for m in bag.messages() if "pusher" in m.topic or "slider" in m.topic
    ]
    begin, end = messages[0][2], messages[-1][2]
    lasts = (end - begin) / SECOND
    for at in np.arange(0.01, lasts, 0.1):
        messages.append((WARMTH, "std_msgs/msg/Float64", begin + int(at * SECOND), float64(rng.normal())))
    for at in np.arange(0.4 * lasts, lasts, 1.0):
        time = begin + int(at * SECOND)
        messages.append((ROD, "sensor_msgs/msg/Temperature", time + 10**6, stamped(time, [20.0 + rng.normal(), 0.0])))
    for at in np.arange(0.3, lasts, 4.0):
        messages.append((HUMIDITY, "std_msgs/msg/Float32", begin + int(at * SECOND), float32(rng.normal())))
    for at in np.arange(0.2, lasts, 0.13):
        time, load = begin + int(at * SECOND), [0.0, 0.0, 0.0, 0.0, rng.normal(), 0.0]
        messages.append(("/fan/load", WRENCH, time + 10**6, stamped(time, load)))
    name = b"\0\1\0\0" + struct.pack("<I", 4) + b"rod\0"
    messages.append((NAME, "std_msgs/msg/String", begin + SECOND, name))
    messages.sort(key=lambda message: message[2])
    return write_bag(folder / "scalars.mcap", messages, {k: str(v) for k, v in bag.metadata["push_rig"].items()})


@pytest.fixture(scope="module")
def model(recording: Path) -> Path:
    """A model that needs the warmth, which changes the contact friction."""
    rig = load_rig_for([recording])
    base = train_model(load_data([recording]), rig, "analytical", name="warm")
    basis = DriverBasis("linear", (f"topic:{WARMTH}",), (0.0,), (1.0,))
    effect = Effect("contact_friction", f"topic:{WARMTH}", basis, np.array([0.05]), np.array([[1e-4]]), np.ones(3))
    predictor = ExtendedPredictor(base.predictor.base, (effect,), np.ones(3))
    path = recording.parent / "warm.pushmodel"
    save_model(replace(base, predictor=predictor), path)
    return path


class Watched:
    """A replay at rate 8 through a validator with the parameter covariate_topics."""

    def __init__(self, recording: Path, model: Path, output: Path) -> None:
        domain = free_domain()
        params = {
            "model": model,
            "output": output,
            "report": False,
            "diagnostics_period": 0.2,
            "covariate_topics": ASKED,
        }
        with (
            ros_context(domain) as node,
            hosted_node("predict_server", domain=domain, params={"models": [str(model)]}),
            hosting_validator(domain=domain, params=params) as process,
        ):
            status = Status(node)
            status.wait_for_first()
            self.before = status.message
            with hosting_replay(domain, recording=recording, rate=8.0):
                process.wait_for_text(WRITTEN, 90.0)
            status.wait_for("state", "waiting for samples")
            assert process.stop() == 0, process.text()
        self.output, self.message, self.values = output, status.message, status.values
        self.messages = [message for _, message, _ in status.all]


@pytest.fixture(scope="module")
def watched(recording: Path, model: Path, tmp_path_factory: pytest.TempPathFactory) -> Watched:
    return Watched(recording, model, tmp_path_factory.mktemp("watched"))


def test_windows_have_the_scalar_values_of_reading_the_recording(watched: Watched, recording: Path) -> None:
    online = load_data([watched.output / "pushes.csv"])
    offline = load_data([recording], topics=Topics(covariates=(FIELD,)))
    assert online.push_id.tolist() == offline.push_id.tolist()
    for topic in (*OURS, FIELD):
        found, expected = online.covariates[f"topic:{topic}"], offline.covariates[f"topic:{topic}"]
        assert np.ptp(expected) > 0.1
        assert np.max(np.abs(found - expected)) < 1e-9, topic


def test_a_model_that_needs_a_topic_scores_as_offline(watched: Watched, model: Path, recording: Path) -> None:
    assert_same_as_offline(watched.output, model, recording)
    log = json.loads((watched.output / "windows.json").read_text())
    assert log["refused"] == [] and log["unanswered"] == 0


def test_topics_without_samples_are_named(watched: Watched) -> None:
    for topic in (*OURS, "/nowhere"):
        assert f"{topic}: No publisher." in watched.before
    assert "/nowhere: No publisher." in watched.message
    wrong = "covariate_topics 'rod/name': rod/name is of type 'std_msgs/msg/String'; no field of it is a number"
    assert any(wrong in message for message in watched.messages), "while it was published"
    assert any(not any(topic in message for topic in OURS) for message in watched.messages), "while they were"
    counts = [int(watched.values[f"topic:{topic} samples"]) for topic in OURS]
    assert counts[0] > 100 > counts[1] > counts[2] > 1
    assert [watched.values[f"topic:{topic} rejected"] for topic in OURS] == ["0"] * len(OURS)
    assert watched.values[f"topic:{OURS[0]} topic"].startswith(f"topic:{OURS[0]}: {OURS[0]}, ")


# --- the subscriber alone --------------------------------------------------------------------------------------------


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


class Subscriber:
    """A scalar topic of a node without the sensors, and its decoder."""

    def __init__(self, node: Node, name: str) -> None:
        self.decoder, self.clock = StreamDecoder(Topics(covariates=(name,))), ClockTopic(node)
        ((key, self.own),) = self.decoder.scalars.items()
        self.topic = ScalarTopic(node, key, self.own, self.clock.history)

    @property
    def problem(self) -> str:
        return self.topic.report().problem

    def take(self, last: bool = False) -> dict[str, ScalarStream]:
        for each in (self.topic, self.clock):
            each.look()
            each.move()
        self.topic.date(last)
        return self.decoder.take_scalars(last=True)


class Gathered:
    """The samples that a subscriber has taken of one topic."""

    def __init__(self, subscriber: Subscriber, name: str) -> None:
        self._subscriber, self._name = subscriber, name
        self.stamp: list[int] = []
        self.value: list[float] = []

    def has(self, condition: Callable[[Gathered], bool], timeout: float = 60.0) -> bool:
        def found() -> bool:
            self._add(self._subscriber.take())
            return condition(self)

        return wait_until(found, timeout)

    def _add(self, taken: dict[str, ScalarStream]) -> None:
        if self._name in taken:
            self.stamp += taken[self._name].stamp.tolist()
            self.value += taken[self._name].value.tolist()


def best_effort() -> QoSProfile:
    return QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


def kept() -> QoSProfile:
    return QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.mark.parametrize("profile", [best_effort(), kept(), QoSProfile(depth=10)], ids=["lossy", "kept", "reliable"])
def test_subscribes_to_a_later_topic_with_the_qos_of_its_publisher(
    listener: Node, talker: Node, profile: QoSProfile
) -> None:
    subscriber = Subscriber(listener, "warmth")
    assert subscriber.take() == {} and subscriber.problem == "No publisher."
    gathered = Gathered(subscriber, "/warmth")
    with offered(talker, String, QoSProfile(depth=10)):
        assert gathered.has(lambda _: "std_msgs/msg/String" in subscriber.problem)
        assert "covariate_topics 'warmth': " in subscriber.problem
    message = Temperature(temperature=21.5)
    message.header.stamp.sec = 7
    with offered(talker, Temperature, profile) as publisher:
        assert gathered.has(publishing(publisher, message, 21.5))
        assert {*gathered.value} == {21.5} and {*gathered.stamp} == {7 * SECOND} and not subscriber.problem
    with offered(talker, Float32, profile) as publisher:
        assert gathered.has(publishing(publisher, Float32(data=0.5), 0.5)), "another type from now on"


@contextmanager
def offered(node: Node, kind: type, profile: QoSProfile) -> Iterator[Publisher]:
    """A publisher that is destroyed at once on leaving; an executor waiting for its events would delay that."""
    silent = PublisherEventCallbacks(use_default_callbacks=False)
    publisher = node.create_publisher(kind, "warmth", profile, event_callbacks=silent)
    yield publisher
    node.destroy_publisher(publisher)


def publishing(publisher: Any, message: Any, value: float) -> Callable[[Gathered], bool]:
    """Publish until the value is received; where messages are kept, only once, before anybody has subscribed."""
    once = publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    publisher.publish(message)

    def received(so_far: Gathered) -> bool:
        if not once:
            publisher.publish(message)
        return value in so_far.value

    return received


def test_a_field_of_any_type_is_a_scalar(listener: Node, talker: Node) -> None:
    subscriber = Subscriber(listener, "warmth.position[1]")
    gathered = Gathered(subscriber, "/warmth.position[1]")
    with offered(talker, Temperature, QoSProfile(depth=10)):
        assert gathered.has(lambda _: "and has no number in field 'position[1]', give one of" in subscriber.problem)
    message = JointState(position=[0.5, 1.5])
    message.header.stamp.sec = 7
    with offered(talker, JointState, QoSProfile(depth=10)) as publisher:
        assert gathered.has(publishing(publisher, message, 1.5))
        assert {*gathered.value} == {1.5} and {*gathered.stamp} == {7 * SECOND} and not subscriber.problem


def test_without_a_clock_a_sample_is_dated_by_its_sending_time(listener: Node, talker: Node) -> None:
    subscriber, publisher = (
        Subscriber(listener, "/cell/warmth"),
        talker.create_publisher(Float64, "warmth", kept()),
    )
    begin = talker.get_clock().now().nanoseconds
    publisher.publish(Float64(data=1.0))
    end = talker.get_clock().now().nanoseconds
    gathered = Gathered(subscriber, "/cell/warmth")
    assert gathered.has(lambda so_far: bool(so_far.value))
    assert gathered.value == [1.0] and begin <= gathered.stamp[0] <= end


def test_with_a_clock_a_sample_is_dated_by_the_last_tick(listener: Node, talker: Node) -> None:
    subscriber = Subscriber(listener, "warmth")
    clock = talker.create_publisher(Clock, "/clock", kept())
    publisher = talker.create_publisher(Float32, "warmth", kept())
    for second in range(5):
        message = Clock()
        message.clock.sec, message.clock.nanosec = second, 5
        clock.publish(message)
        publisher.publish(Float32(data=second + 0.5))
    gathered = Gathered(subscriber, "/warmth")
    assert gathered.has(lambda so_far: len(so_far.value) == 4)
    assert gathered.stamp == [second * SECOND + 5 for second in range(4)]
    assert subscriber.take(last=True)["/warmth"].value.tolist() == [4.5], "no later tick came"


def test_stamps_of_another_clock_and_nan_are_rejected_and_counted(listener: Node, talker: Node) -> None:
    subscriber = Subscriber(listener, "warmth")
    publisher = talker.create_publisher(Temperature, "warmth", kept())
    for sec, value in ((100, 1.0), (100_000, 2.0), (101, float("nan"))):
        message: Any = Temperature(temperature=value)
        message.header.stamp.sec = sec
        publisher.publish(message)
    subscriber.decoder.inputs()["slider"].declare("geometry_msgs/msg/PoseStamped", {})
    here = stamped(90 * SECOND, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    subscriber.decoder.put(Messages.of("slider/pose", "geometry_msgs/msg/PoseStamped", [0], [here]))
    subscriber.decoder.take()
    gathered = Gathered(subscriber, "/warmth")
    assert gathered.has(lambda _: subscriber.own.received == 3)
    assert gathered.value == [1.0]
    assert subscriber.own.rejected == {"not finite": 1, "another clock": 1}
