# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_recorder and `push_predictor record` as processes: what they write is what was published."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hosted_nodes import refused_start
from mcap.reader import make_reader
from planar_messages import pose_message
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_harness import REPOSITORY, free_domain, node_environment, node_process, ros_context, wait_until
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float32, Float64, String
from validator_bench import HEXAGON, Status, beginning, hosting_replay

from push_predictor.cli import main as push_predictor
from push_predictor.errors import RecordingError, RequestError
from push_predictor.nodes import push_recorder, runtime
from push_predictor.nodes.parameter_tables import PUSH_RECORDER
from push_predictor.nodes.parameters import declare, values_of
from push_predictor.nodes.push_recorder import RecorderSubscriptions, new_recording
from push_predictor.nodes.qos import KEPT
from push_predictor.online.live_recording import LiveRecording
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.topics import Topics

pytestmark = pytest.mark.slow

TEMPERATURE, LOSSY = "/surface/temperature", "/lossy"
BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)


class Recorded:
    """A replay at rate 5 and a best-effort publisher, recorded by push_recorder."""

    def __init__(self, bag: Path, original: Path) -> None:
        domain, self.bag, self.original = free_domain(), bag, original
        params = {"bag": bag, "covariate_topics": ["surface/temperature", LOSSY], "diagnostics_period": 0.2}
        with ros_context(domain) as node, node_process("push_recorder", domain=domain, params=params) as process:
            status = Status(node, "push_recorder")
            status.wait_for_first()
            publisher = node.create_publisher(Float32, LOSSY, BEST_EFFORT)
            node.create_timer(0.05, lambda: publisher.publish(Float32(data=0.5)))
            self.began = time.time_ns()
            with hosting_replay(domain, recording=original, rate=5.0) as replay:
                replay.wait_for_text("finished: published")
                # The last pushes end before the last samples, and a status is sent only every 0.2 s.
                status.wait_for("windows", "15")
                status.wait_for("slider samples", str(len(read_recording(original).slider.stamp)))
            self.ended = time.time_ns()
            self.waiting, self.last, self.identity = status.all[0][2], status.values, status.identity
            self.status, self.text = process.stop(signal.SIGINT), process.text()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    folder = tmp_path_factory.mktemp("recorded")
    return Recorded(folder / "monday", beginning(HEXAGON, 5.2, folder / "original"))


def test_ctrl_c_ends_the_recording_with_status_0_and_a_summary(recorded: Recorded) -> None:
    assert recorded.status == 0, recorded.text
    assert f"{recorded.bag}: " in recorded.text and "15 windows of 3 pushes" in recorded.text


def test_every_message_is_unchanged_and_logged_when_it_arrived(recorded: Recorded) -> None:
    original, copy = open_bag(recorded.original), open_bag(recorded.bag)
    for topic in ("/slider/pose", "/pusher/pose", "/pusher/wrench", TEMPERATURE):
        sent, got = list(original.messages([topic])), list(copy.messages([topic]))
        assert [message.data for message in got] == [message.data for message in sent]
        times = [message.log_time for message in got]
        assert recorded.began < times[0] and times == sorted(times) and times[-1] < recorded.ended
        assert times[-1] - times[0] > 0.5 * (sent[-1].log_time - sent[0].log_time) / 5.0, "as they came, at rate 5"
    assert (
        not copy.notes and list(copy.messages([LOSSY])) and copy.metadata["push_rig"] == original.metadata["push_rig"]
    )


def test_qos_and_definitions_are_those_of_the_publishers(recorded: Recorded) -> None:
    bag = open_bag(recorded.bag)
    assert "best_effort" in bag.qos[LOSSY] and "best_effort" not in bag.qos["/slider/pose"]
    assert "transient_local" in bag.qos[TEMPERATURE]
    assert "MSG: geometry_msgs/Wrench" in bag.schemas["geometry_msgs/msg/WrenchStamped"]
    with (recorded.bag / "monday_0.mcap").open("rb") as stream:
        times = [message.log_time for _, _, message in make_reader(stream, validate_crcs=True).iter_messages()]
    assert abs(times[-1] - time.time_ns()) < 600e9


def test_diagnostics_have_the_state_and_the_figures(recorded: Recorded) -> None:
    assert recorded.waiting["state"] == "waiting for messages" and recorded.waiting["windows"] == "-"
    assert recorded.last["state"] == "recording" and recorded.last["pushes"] == "3"
    assert recorded.last["slider samples"] == str(len(read_recording(recorded.original).slider.stamp))
    assert float(recorded.last["slider rate"]) == pytest.approx(100.0, rel=0.01)
    assert 0.5 < float(recorded.last["share of contact"]) < 0.8
    assert recorded.identity == ("/push_recorder: recording", "hex")


# --- the command, and ends of a recording ----------------------------------------------------------------------------


def command(domain: int, *options: object) -> subprocess.Popen[str]:
    words = [sys.executable, "-m", "push_predictor.cli", "record", *map(str, options)]
    return subprocess.Popen(
        words, cwd=REPOSITORY, env=node_environment(domain), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def test_ctrl_c_before_the_first_message_writes_nothing_and_says_so(tmp_path: Path) -> None:
    domain = free_domain()
    with ros_context(domain) as node:
        status = Status(node, "push_recorder")
        process = command(domain, "--out", tmp_path / "a")
        status.wait_for_first()
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=30.0)
    assert process.returncode == 0 and "Traceback" not in errors
    assert output.splitlines() == ["No message arrived. No bag was written.", *output.splitlines()[1:]]
    assert "No publisher of /slider/pose." in output and list(tmp_path.iterdir()) == []


def test_the_command_ends_by_itself_after_its_duration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    domain, rig = free_domain(), REPOSITORY / "docs" / "reference" / "rig.yaml"
    monkeypatch.setattr(runtime, "_handle_signals", lambda *_: None)  # those of this process
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    options = ("--slider-topic", "/vicon/block", "--rig", rig, "--duration", 0.5, "--json", "-")
    with ros_context(domain) as node, published(node, "/vicon/block"):
        assert push_predictor(["record", "--out", str(tmp_path / "a.mcap"), *map(str, options)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["recording"] == str(tmp_path / "a.mcap") and result["seconds"] > 0.4
    assert result["streams"]["/vicon/block"]["samples"] == result["messages"]["/vicon/block"] > 0
    assert result["windows"] == 0 and result["problems"] == ["No publisher of /pusher/pose."]
    assert "push_rig" in open_bag(tmp_path / "a.mcap").metadata


def test_a_full_disk_ends_the_node_with_an_error_that_names_the_bag(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """test_recorder has the disk."""

    def full(recording: LiveRecording, *_: object, **__: object) -> None:
        raise RecordingError(f"{recording.path}: cannot be written (File too large)")

    def recorded_while_published(arguments: list[str]) -> int:
        with ros_context(int(os.environ["ROS_DOMAIN_ID"])) as node, published(node, "slider/pose"):
            return push_recorder.main(arguments)

    monkeypatch.setattr(LiveRecording, "write", full)
    monkeypatch.setattr(push_recorder, "print", lambda text: None, raising=False)  # the summary
    line = refused_start(recorded_while_published, monkeypatch, capfd, bag=tmp_path / "a")
    assert line == f"push_recorder: {tmp_path / 'a'}: cannot be written (File too large)"


@contextmanager
def published(node: Node, topic: str) -> Iterator[None]:
    """A pose a hundred times a second."""
    publisher = node.create_publisher(type(pose_message(0, 0, 0, 0, 0)), topic, BEST_EFFORT)
    timer = node.create_timer(0.01, lambda: publisher.publish(pose_message(time.time_ns(), 0.1, 0.2, 0.0, 0.3)))
    yield
    timer.cancel()


# --- parameters ------------------------------------------------------------------------------------------------------


def recording_of(**values: object) -> LiveRecording:
    with ros_context(free_domain(), namespace="cell") as node:
        overrides = {name.replace("__", "."): value for name, value in values.items()}
        node._parameter_overrides = {name: Parameter(name, value=value) for name, value in overrides.items()}
        declare(node, PUSH_RECORDER)
        return new_recording(node, values_of(node, PUSH_RECORDER))


def wanted(recording: LiveRecording) -> dict[str, bool]:
    """Whether each topic is expected."""
    return {topic.name: topic.expected for topic in recording.wanted}


def test_names_are_resolved_in_the_namespace_of_the_node(tmp_path: Path) -> None:
    found = recording_of(bag=str(tmp_path / "a"), pusher_topic="/tf:tool0", covariate_topics=["driver.currents[2]"])
    expected = Topics("/cell/slider/pose", "/tf:tool0", "/cell/pusher/wrench", ("/cell/driver.currents[2]",))
    assert found.topics == expected and found.path == tmp_path / "a"
    assert not wanted(found)["/cell/pusher/wrench"]


def test_topics_saved_next_to_an_earlier_bag_are_used_again(tmp_path: Path) -> None:
    (tmp_path / "a.recording.yaml").write_text("slider_topic: /block\nwrench_topic: /netft\n")
    found = recording_of(bag=str(tmp_path / "a"), slider_topic="/other")
    assert (found.topics.slider, found.topics.wrench) == ("/other", "/netft") and wanted(found)["/netft"]


def test_an_existing_bag_is_replaced_only_with_force(tmp_path: Path) -> None:
    (bag := tmp_path / "a.mcap").touch()
    with pytest.raises(RequestError, match=r"bag: .* is not accepted, give a path that does not exist, or force"):
        recording_of(bag=str(bag))
    assert recording_of(bag=str(bag), force=True).path == bag


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({}, "bag: '' is not accepted"),
        ({"bag": "/nowhere/a", "slider_topic": "1 block"}, "topic: '1 block' is not accepted"),
        ({"bag": "/nowhere/a", "wrench_topic": "/tf:ft"}, "wrench_topic: '/tf:ft' is not accepted"),
        ({"bag": "/nowhere/a", "duration": -1.0}, "duration: -1.0 is not accepted"),
    ],
)
def test_bad_parameters_are_refused_by_name_and_value(values: dict[str, Any], problem: str) -> None:
    with pytest.raises(RequestError) as caught:
        recording_of(**values)
    assert problem in str(caught.value)


# --- subscriptions alone ---------------------------------------------------------------------------------------------


class Listening:
    """The subscriptions of a recorder in this process."""

    def __init__(self, node: Node, path: Path, *topics: str) -> None:
        self.path, self.recording = path, LiveRecording(path, Topics("/a", "/b", "/c", topics), 0.0, with_wrench=False)
        self._subscriptions = RecorderSubscriptions(node, self.recording)

    def until(self, condition: Callable[[], bool]) -> bool:
        def looked() -> bool:
            self._subscriptions.drain()
            self._subscriptions.look()
            return condition()

        return wait_until(looked)

    def count(self, topic: str) -> int:
        return self.recording.progress(0.0).messages[topic]

    def problem(self, topic: str) -> str:
        return self.recording.progress(0.0).problems.get(topic, "")


def test_a_second_type_is_named_and_not_recorded(tmp_path: Path) -> None:
    domain = free_domain()
    with ros_context(domain) as node:
        listening = Listening(node, tmp_path / "a", "/warmth")
        assert listening.until(lambda: "No publisher of /warmth." in listening.problem("/warmth"))
        with ros_context(domain) as first:
            first.create_publisher(Float64, "/warmth", KEPT).publish(Float64(data=1.0))
            assert listening.until(lambda: listening.count("/warmth") == 1)
        with ros_context(domain) as second:
            second.create_publisher(String, "/warmth", KEPT).publish(String(data="warm"))
            now, before = "std_msgs/msg/String", "std_msgs/msg/Float64"
            expected = f"/warmth is now of type {now}. Only its first type, {before}, is recorded."
            assert listening.until(lambda: listening.problem("/warmth") == expected)
        listening.recording.close(1.0)
    assert [message.type for message in open_bag(tmp_path / "a").messages()] == ["std_msgs/msg/Float64"]


def test_messages_of_different_topics_are_written_in_order_of_arrival(tmp_path: Path) -> None:
    with ros_context(free_domain()) as node:
        listening = Listening(node, tmp_path / "a")
        publishers = {topic: node.create_publisher(Float64, topic, KEPT) for topic in ("/a", "/b")}
        assert listening.until(lambda: all(listening.recording.type_of(topic) for topic in publishers))
        for topic in ("/b", "/a", "/b"):
            publishers[topic].publish(Float64(data=1.0))
            time.sleep(0.1)
        assert listening.until(lambda: (listening.count("/a"), listening.count("/b")) == (1, 2))
        listening.recording.close(1.0)
    messages = list(open_bag(tmp_path / "a").messages())
    assert [message.topic for message in messages] == ["/b", "/a", "/b"]
    assert messages[1].log_time - messages[0].log_time > 0.05e9, "when they arrived, not when they were taken"


def test_two_types_at_once_are_named(tmp_path: Path) -> None:
    domain = free_domain()
    with ros_context(domain) as node, ros_context(domain) as one, ros_context(domain) as other:
        one.create_publisher(Float64, "/warmth", KEPT)
        other.create_publisher(String, "/warmth", KEPT)
        assert wait_until(lambda: node.count_publishers("/warmth") == 2)
        listening = Listening(node, tmp_path / "a", "/warmth")
        types = "std_msgs/msg/Float64 and std_msgs/msg/String"
        expected = f"/warmth has publishers of the types {types}. One type is accepted."
        assert listening.until(lambda: listening.problem("/warmth") == expected)


def test_a_type_that_is_not_installed_is_named(tmp_path: Path) -> None:
    offered = [SimpleNamespace(topic_type="lab_msgs/msg/Warmth")]
    node: Any = SimpleNamespace(resolve_topic_name=str, get_publishers_info_by_topic=lambda topic: offered)
    recording = LiveRecording(tmp_path / "a", Topics("/a", "/b", "/c", ("/warmth",)), 0.0, with_wrench=False)
    RecorderSubscriptions(node, recording).look()
    problem = recording.progress(0.0).problems["/warmth"]
    assert problem.startswith("/warmth is not recorded: type lab_msgs/msg/Warmth is not installed (")


def test_with_simulated_time_messages_wait_for_the_clock_and_get_its_time(tmp_path: Path) -> None:
    with ros_context(free_domain()) as node:
        node.set_parameters([Parameter("use_sim_time", value=True)])
        listening = Listening(node, tmp_path / "a", "/warmth")
        publisher, clock = node.create_publisher(Float64, "/warmth", KEPT), node.create_publisher(Clock, "/clock", KEPT)
        publisher.publish(Float64(data=1.0))
        assert listening.until(lambda: listening.recording.type_of("/warmth") != "")
        deadline = time.monotonic() + 0.5
        listening.until(lambda: time.monotonic() > deadline)
        assert listening.count("/warmth") == 0
        tick = Clock()
        tick.clock.sec = 77
        clock.publish(tick)
        assert listening.until(lambda: listening.count("/warmth") == 1)
        listening.recording.close(1.0)
    assert [message.log_time for message in open_bag(tmp_path / "a").messages()] == [77 * 10**9]
