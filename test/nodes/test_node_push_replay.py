# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_replay as a process: topics, services, signals."""

from __future__ import annotations

import itertools
import json
import re
import statistics
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
import yaml
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, WrenchStamped
from hosted_nodes import hosted_node
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from replay_bags import RIG, START, push_messages, write_bag
from ros_harness import acquaint, call, free_domain, node_process, ros_context, wait_until
from rosgraph_msgs.msg import Clock

from msg_adapters.rigs import rig_from_message
from push_predictor.nodes import push_replay
from push_predictor.nodes.qos import CLOCK, LATCHED
from push_predictor.recordings.rig import Rig, rig_from_record
from push_predictor_interfaces.msg import PushRig, ReplayStatus
from push_predictor_interfaces.srv import (
    Burst,
    GetRate,
    IsPaused,
    Pause,
    Play,
    PlayNext,
    Resume,
    Seek,
    SetRate,
    Stop,
    TogglePaused,
)

KINDS = {"slider/pose": PoseStamped, "pusher/pose": PoseStamped, "pusher/wrench": WrenchStamped}
CONTROLS = (Burst, GetRate, Pause, Play, PlayNext, Resume, Seek, SetRate, Stop, TogglePaused, IsPaused)


class ReplayClient:
    """A node in the test's process that subscribes to everything a replay publishes."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.raw: dict[str, list[bytes]] = {topic: [] for topic in KINDS}
        self.rig: list[Rig] = []
        self.states: list[str] = []
        self.clock: list[int] = []
        self.reports: list[dict[str, str]] = []
        # All clients at once: when one is answered, the replay has discovered the others, and no answer is lost.
        names = {kind: re.sub(r"(?<=[a-z])(?=[A-Z])", "_", kind.__name__).lower() for kind in CONTROLS}
        self.controls = {kind: node.create_client(kind, f"push_replay/{name}") for kind, name in names.items()}
        for topic, kind in KINDS.items():
            node.create_subscription(kind, topic, self.raw[topic].append, 5000, raw=True)
        node.create_subscription(PushRig, "rig", lambda m: self.rig.append(rig_from_message(m, "topic")), LATCHED)
        node.create_subscription(ReplayStatus, "replay_status", self._note, LATCHED)
        node.create_subscription(Clock, "/clock", lambda m: self.clock.append(nanoseconds(m.clock)), CLOCK)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._report, 100)

    def _note(self, message: ReplayStatus) -> None:
        self.states.append({1: "playing", 2: "paused", 3: "finished"}[message.state])

    def _report(self, message: DiagnosticArray) -> None:
        self.reports.append({pair.key: pair.value for pair in message.status[0].values})

    @property
    def received(self) -> int:
        return sum(map(len, self.raw.values()))

    def wait_for(self, state: str) -> None:
        assert wait_until(lambda: self.states[-1:] == [state]), f"received {self.states}, not {state}"

    def report(self, state: str) -> dict[str, str]:
        """The diagnostics of a replay in `state`."""
        assert wait_until(lambda: bool(self.reports) and self.reports[-1]["state"] == state, 120.0), self.states
        return self.reports[-1]

    def receive_all(self, state: str) -> int:
        """Wait for all messages that a replay in `state` has published; returns their number.

        A state can arrive before a backlog of messages.
        """
        published = int(self.report(state)["published"])
        assert wait_until(lambda: self.received >= published), f"received {self.received} of {published}"
        return published


@contextmanager
def replay(
    bag: Path, *ros_args: str, namespace: str | None = None, **params: Any
) -> Iterator[tuple[Any, ReplayClient]]:
    """A replay that starts when the test has subscribed, without its check; parameters with `__` for a dot."""
    domain = free_domain()
    names = {name.replace("__", "."): value for name, value in params.items()}
    given = {"recording": bag, "wait_for_subscribers": 60.0, "play.wait_acked_timeout": 60.0, **names}
    with patch.object(push_replay, "LARGEST_CHECKED", 0), ros_context(domain, namespace) as node:
        client = ReplayClient(node)
        with hosted_node("push_replay", *ros_args, domain=domain, namespace=namespace, params=given) as process:
            yield process, client


def nanoseconds(time: Time) -> int:
    return int(time.sec) * 10**9 + int(time.nanosec)


def stamp(data: bytes) -> int:
    seconds, rest = struct.unpack_from("<iI", data, 4)
    return int(seconds) * 10**9 + int(rest)


def recorded(messages: list[tuple[str, str, int, bytes]], topic: str) -> list[bytes]:
    return [data for name, _, _, data in messages if name == f"/{topic}"]


@pytest.fixture(scope="module")
def second(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A second without a rig: it is not checked, which would take half a second of processor time."""
    return write_bag(tmp_path_factory.mktemp("bags") / "second.mcap", push_messages(1.0), rig=None)


@pytest.fixture(scope="module")
def with_rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bag(tmp_path_factory.mktemp("bags") / "second.mcap", push_messages(1.0))


def service(client: ReplayClient, kind: Any, **request: Any) -> Any:
    call(client.controls[IsPaused], IsPaused.Request())
    return call(client.controls[kind], kind.Request(**request))


def test_another_process_receives_every_message_once_in_order_and_unchanged(tmp_path: Path) -> None:
    messages = push_messages(4.0)
    bag = write_bag(tmp_path / "pushes.mcap", messages, rig=None)
    waiting = {"wait_for_subscribers": 60.0, "play.wait_acked_timeout": 60.0}
    params = {"recording": bag, "play.rate": 100.0, "exit_when_finished": True, **waiting}
    with ros_context(domain := free_domain()) as node:
        client = ReplayClient(node)
        with node_process("push_replay", domain=domain, params=params) as process:
            assert process.wait(180.0) == 0, process.text()
            printed = process.text()
        assert wait_until(lambda: client.received == len(messages)), printed
    assert f"published {len(messages)} messages" in printed and "lost 0, acknowledged yes" in printed
    for topic in KINDS:
        assert client.raw[topic] == recorded(messages, topic), printed


def test_replay_keeps_its_pace_and_reports_its_lateness(second: Path) -> None:
    with replay(second, play__start_paused=True) as (_, client):
        client.wait_for("paused")
        begin = time.monotonic()
        service(client, Resume)
        assert wait_until(lambda: client.received == len(push_messages(1.0)))
        assert time.monotonic() - begin > 0.99  # from before the first message to after the last
        report = client.report("finished")
        assert not client.clock and client.node.count_publishers("/clock") == 0, "only if it is asked for"
    assert report["published"] == str(len(push_messages(1.0)))
    assert report["lost"] == "0"
    p50, p99, largest = (float(report[f"late_{figure}_us"]) for figure in ("p50", "p99", "max"))
    assert 0.0 < p50 <= p99 <= largest


def test_rig_status_and_clock_are_published(with_rig: Path) -> None:
    end = START + 10**9
    with replay(with_rig, play__clock_publish_frequency=40.0) as (_, client):
        client.wait_for("finished")
        assert [rig.to_record() for rig in client.rig] == [rig_from_record(RIG, "bag").to_record()]
        assert client.states in (["playing", "finished"], ["finished"])
        assert client.clock == sorted(client.clock)
        during = sorted(t for t in set(client.clock) if START <= t < end)
        gaps = [after - before for before, after in itertools.pairwise(during)]
        assert statistics.median(gaps) == pytest.approx(25e6, rel=0.2)  # 40 Hz; some are missing on a busy machine
        assert len(during) < 45
        assert max(client.clock) <= end
        late: list[PushRig] = []
        client.node.create_subscription(PushRig, "rig", late.append, LATCHED)
        assert wait_until(lambda: len(late) == 1), "a late subscriber receives the rig"


def test_rig_file_replaces_the_record_and_qos_follows_parameters(with_rig: Path, tmp_path: Path) -> None:
    (tmp_path / "other.yaml").write_text(yaml.safe_dump({**RIG, "surface": "delrin"}))
    # A reliable subscriber never matches a best-effort publisher.
    options = {"rig": tmp_path / "other.yaml", "play__start_paused": True, "wait_for_subscribers": 0.0}
    override = ("-p", "qos_overrides./pusher/pose.publisher.reliability:=best_effort")
    with replay(with_rig, *override, **options) as (_, client):
        client.wait_for("paused")
        assert wait_until(lambda: bool(client.rig)) and client.rig[0].surface == "delrin"
        (pusher,) = client.node.get_publishers_info_by_topic("/pusher/pose")
        (wrench,) = client.node.get_publishers_info_by_topic("/pusher/wrench")
    assert pusher.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert wrench.qos_profile.reliability == ReliabilityPolicy.RELIABLE


def test_damage_a_missing_rig_and_unknown_types_are_reported(tmp_path: Path) -> None:
    messages = push_messages(3.0)
    alien = [("/alien", "alien_msgs/msg/Saucer", START, b"\0\1\0\0\0\0\0\0")]
    whole = write_bag(tmp_path / "whole.mcap", alien + messages, rig=None).read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) // 2])
    with replay(cut, play__rate=20.0) as (process, client):
        client.receive_all("finished")
        report = client.report("finished")
        received, sent = client.raw["slider/pose"], recorded(messages, "slider/pose")
        assert 100 < len(received) < len(sent) and received == sent[: len(received)]
        assert str(cut) in report["damage"]
        assert wait_until(lambda: "damaged: " in process.text())
        assert "alien_msgs" in json.loads(report["not_published"])["/alien"]
        assert report["published"] == str(client.received)
        assert client.rig == [] and "push_rig lacks shape" in process.text()
        assert "node parameter 'rig'" in process.text()


def test_names_filters_and_range_of_a_playback(with_rig: Path) -> None:
    names = ("-r", "pusher/wrench:=/ft")
    options = {"play__start_offset": 0.5, "play__playback_duration": 0.1, "play__exclude_regex_to_filter": ".*slider.*"}
    with replay(with_rig, *names, namespace="/rig1", play__start_paused=True, **options) as (_, client):
        moved: list[bytes] = []
        client.node.create_subscription(WrenchStamped, "/ft", moved.append, 1000, raw=True)
        client.wait_for("paused")
        acquaint(client.node, "push_replay")
        service(client, Resume)
        client.wait_for("finished")
        assert wait_until(lambda: len(moved) == 12)
        assert [stamp(data) for data in moved] == [START + 10**6 * (504 + 8 * k) for k in range(12)]
        assert client.raw["slider/pose"] == client.raw["pusher/wrench"] == []
        assert wait_until(lambda: bool(client.raw["pusher/pose"] and client.rig))


def test_every_control_of_a_playback(second: Path) -> None:
    total = len(push_messages(1.0))
    with replay(second, play__start_paused=True) as (process, client):
        client.wait_for("paused")
        assert service(client, PlayNext).success
        assert service(client, Burst, num_messages=9).actually_burst == 9
        assert client.receive_all("paused") == 10
        assert not service(client, Play).success
        assert service(client, Seek, time=Time(sec=START // 10**9, nanosec=900_000_000)).success
        assert service(client, Burst, num_messages=0).actually_burst == 62
        client.wait_for("finished")
        assert client.report("finished")["acknowledged"] == "yes"
        service(client, TogglePaused)
        assert not service(client, IsPaused).paused

        assert not service(client, SetRate, rate=0.0).success and service(client, SetRate, rate=0.1).success
        assert service(client, GetRate).rate == pytest.approx(0.1)
        assert service(client, Play).success
        client.wait_for("playing")
        service(client, Pause)
        client.wait_for("paused")
        published = client.receive_all("paused")
        time.sleep(0.3)
        assert client.received == published < total
        service(client, Resume)
        client.wait_for("playing")
        client.reports.clear()
        service(client, Stop)
        client.receive_all("finished")

        for messages in client.raw.values():
            messages.clear()
        assert service(client, SetRate, rate=5.0).success
        assert service(client, Play, start_offset=Time(nanosec=500_000_000)).success
        assert wait_until(lambda: client.received == total - 313)
        client.wait_for("finished")
        service(client, SetRate, rate=0.01)
        service(client, Play)
        client.wait_for("playing")
        begun = time.monotonic()
        assert process.stop() == 0 and time.monotonic() - begun < 20.0, "without the request it would play for longer"
        assert "Traceback" not in process.text() and "playing: published" in process.text()
