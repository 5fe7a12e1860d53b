# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Discovery, security and health of real nodes over DDS.

Other machines are network namespaces joined by a cable; where these cannot be made, the test says so and is skipped.
"""

from __future__ import annotations

import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from hosted_nodes import hosted_node, refused_start
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.node import Node
from replay_bags import push_messages, write_bag
from ros_harness import REPOSITORY, acquaint, call, free_domain, node_environment, ros_context, wait_until
from validator_bench import HEXAGON

from push_predictor.models.store.model_file import save_model
from push_predictor.models.train import train_model
from push_predictor.nodes import predict_server, push_replay, push_validator
from push_predictor.nodes.network_security import DISCOVERY, RANGE, limit_discovery
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor_interfaces.srv import Resume

NODES = {
    "predict_server": "push_predictor",
    "push_recorder": "push_recorder",
    "push_replay": "push_replay",
    "push_validator": "push_validator",
}


# --- security that the middleware does not have ----------------------------------------------------------------------


ENFORCED = {"STRATEGY": "Enforce", "KEYSTORE": str(REPOSITORY)}
MAIN = {"predict_server": predict_server.main, "push_validator": push_validator.main}


@pytest.mark.parametrize(
    ("executable", "environment", "words"),
    [
        ("predict_server", {**ENFORCED, "ENABLE": "true"}, ["built with DDS security", "ROS_SECURITY_ENABLE=true"]),
        ("push_validator", {"ENABLE": "true"}, ["built with DDS security", "ROS_SECURITY_ENABLE=true"]),
        ("push_validator", {"ENABLE": "True"}, ["ROS_SECURITY_ENABLE=True does not enable security"]),
    ],
)
def test_a_node_refuses_to_start_without_the_requested_security_also_if_it_is_not_enforced(
    executable: str,
    environment: Mapping[str, str],
    words: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
):
    """rcl alone would start an unprotected node without a warning: it enforces nothing, and accepts only `true`."""
    for name, value in environment.items():
        monkeypatch.setenv(f"ROS_SECURITY_{name}", value)
    line = refused_start(MAIN[executable], monkeypatch, capfd)
    assert line.startswith(f"{executable}: ") and all(word in line for word in words), line


# --- discovery -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("outside", "limited"),
    [({}, True), ({RANGE: ""}, True), ({RANGE: "SUBNET"}, False), ({"ROS_STATIC_PEERS": "10.0.0.1"}, False)],
)
def test_discovery_is_limited_to_this_machine_unless_the_environment_sets_a_range(
    outside: Mapping[str, str], limited: bool, monkeypatch: pytest.MonkeyPatch
):
    for name in DISCOVERY:
        monkeypatch.delenv(name, raising=False)
    for name, value in outside.items():
        monkeypatch.setenv(name, value)
    assert limit_discovery() == limited
    assert os.environ.get(RANGE) == ("LOCALHOST" if limited else outside.get(RANGE))


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True, timeout=10.0)


@contextmanager
def two_machines() -> Iterator[tuple[str, str]]:
    """Two network namespaces joined by a cable."""
    names = [f"push{os.getpid()}{end}" for end in "ab"]
    try:
        for name in names:
            ip("netns", "add", name)
        cables = [f"v{os.getpid()}{end}" for end in "ab"]
        ip("link", "add", cables[0], "netns", names[0], "type", "veth", "peer", "name", cables[1], "netns", names[1])
        for k, (name, cable) in enumerate(zip(names, cables, strict=True)):
            ip("-n", name, "address", "add", f"10.213.57.{k + 1}/24", "dev", cable)
            for link in ("lo", cable):
                ip("-n", name, "link", "set", link, "up")
            ip("-n", name, "route", "add", "default", "dev", cable)
        yield names[0], names[1]
    except (FileNotFoundError, subprocess.CalledProcessError) as error:
        pytest.skip(f"network namespaces cannot be made here: {getattr(error, 'stderr', error)}")
    finally:
        for name in names:
            subprocess.run(["ip", "netns", "delete", name], capture_output=True)


LOOK = """
import sys, time, rclpy
rclpy.init()
node, end = rclpy.create_node("visitor"), time.monotonic() + 25.0
while time.monotonic() < end and "open" not in node.get_node_names():
    time.sleep(0.05)
time.sleep(3.0)
print(*node.get_node_names())
"""


def on(machine: str, environment: Mapping[str, str], *command: str, **how: Any) -> subprocess.Popen[str]:
    unset = [word for name in DISCOVERY for word in ("-u", name)]
    words = ["ip", "netns", "exec", machine, "env", *unset, *(f"{k}={v}" for k, v in environment.items()), *command]
    # Network namespaces share memory, and so would all tests in this domain: use UDP alone.
    alone = {**node_environment(DOMAIN), "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    return subprocess.Popen(words, env=alone, cwd=REPOSITORY, text=True, **how)


DOMAIN = 57  # these machines have no other nodes


@pytest.mark.slow
def test_another_machine_discovers_a_node_only_on_request(tmp_path: Path):
    """The visitor has ROS's default range. It would discover both nodes at the same time."""
    logs = {"push_validator": tmp_path / "closed", "open": tmp_path / "open"}
    with two_machines() as (here, there), ExitStack() as stack:
        for name, log in logs.items():
            output = stack.enter_context(log.open("w"))
            module = (sys.executable, "-m", "push_predictor.nodes.push_validator", "--ros-args", "-r")
            asked = {RANGE: "SUBNET"} if name == "open" else {}
            node = on(here, asked, *module, f"__node:={name}", stdout=output, stderr=output)
            stack.callback(node.wait, 30.0)
            stack.callback(node.terminate)
        assert wait_until(lambda: all("Waiting for" in log.read_text() for log in logs.values()))
        visitor = on(there, {}, sys.executable, "-c", LOOK, stdout=subprocess.PIPE)
        assert {*visitor.communicate(timeout=60.0)[0].split()} == {"visitor", "open"}
    limited = ["Other machines cannot discover this node" in log.read_text() for log in logs.values()]
    assert limited == [True, False]


# --- health and policy: four nodes, /clock standing still ------------------------------------------------------------


@dataclass
class Listener:
    """When each node reported its health, by its own clock, and its state then."""

    reports: dict[str, list[tuple[float, str]]] = field(default_factory=dict)

    def __call__(self, message: DiagnosticArray, info: Mapping[str, int]) -> None:
        for status in message.status:
            state = {pair.key: pair.value for pair in status.values}["state"]
            node = status.name.split(":")[0].strip("/")
            self.reports.setdefault(node, []).append((1e-9 * info["source_timestamp"], state))

    def in_state(self, node: str, state: str) -> list[float]:
        return [when for when, text in self.reports.get(node, []) if text == state]


@dataclass(frozen=True)
class Graph:
    """The three nodes, idle while /clock stands still."""

    node: Node
    listener: Listener

    def change(self, transition: int) -> None:
        client = self.node.create_client(ChangeState, "/push_predictor/change_state")
        acquaint(self.node, "/push_predictor")  # a repeated transition is refused
        assert call(client, ChangeState.Request(transition=Transition(id=transition))).success


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    model, data = tmp_path_factory.mktemp("model") / "small.pushmodel", [HEXAGON]
    save_model(train_model(load_data(data), load_rig_for(data), "analytical", name="small"), model)
    bag = write_bag(tmp_path_factory.mktemp("second") / "second.mcap", push_messages(1.0), rig=None)
    params: dict[str, dict[str, Any]] = {
        "predict_server": {"models": [str(model)], "autostart": False, "introspection": "metadata"},
        "push_replay": {"recording": bag, "play.start_paused": True, "play.clock_publish_frequency": 0.0},
        "push_validator": {},
        "push_recorder": {"bag": tmp_path_factory.mktemp("recorded") / "bag"},
    }
    domain = free_domain()
    with ExitStack() as stack:
        node = stack.enter_context(ros_context(domain))
        listener = Listener()
        node.create_subscription(DiagnosticArray, "/diagnostics", listener, 100)
        stack.enter_context(patch.object(push_replay, "LARGEST_CHECKED", 0))  # a check takes a second of processor time
        for executable, given in params.items():
            given = {"use_sim_time": True, **given}
            stack.enter_context(hosted_node(executable, domain=domain, params=given))
        assert wait_until(lambda: set(listener.reports) == set(NODES.values())), listener.reports
        yield Graph(node, listener)


def assert_every_second(graph: Graph, node: str, state: str) -> None:
    """Assert reports of this state, one second apart; the first may be delayed by the transition."""
    assert wait_until(lambda: len(graph.listener.in_state(node, state)) >= 5, 60.0), graph.listener.reports
    gaps = np.diff(graph.listener.in_state(node, state)[1:5])
    assert 0.75 < np.median(gaps) < 1.75, gaps


RULES = {
    ("topics", "publish"), ("topics", "subscribe"), ("services", "reply"), ("services", "request"),
    ("actions", "execute"),
}  # fmt: skip


def permissions(ns: str = "/") -> dict[str, dict[tuple[str, str], set[str]]]:
    """The permissions of config/sros2_policy.xml by node: {(kind, use): full names}."""
    root = ET.parse(REPOSITORY / "config" / "sros2_policy.xml").getroot()
    allowed: dict[str, dict[tuple[str, str], set[str]]] = {}
    for enclave in root.findall("enclaves/enclave"):
        for profile in enclave.findall("profiles/profile"):
            node, rules = profile.attrib["node"], allowed.setdefault(profile.attrib["node"], {})
            assert profile.attrib["ns"] == ns and enclave.attrib["path"].startswith("/push_predictor/")
            for group in profile:
                for how, verdict in group.attrib.items():
                    assert verdict == "ALLOW" and (group.tag, how) in RULES
                    names = rules.setdefault((group.tag, how), set())
                    names |= {full_name(str(entry.text), node) for entry in group}
    return allowed


def full_name(name: str, node: str) -> str:
    return name if name.startswith("/") else f"/{node}{name[1:]}" if name.startswith("~") else f"/{name}"


def with_parts_of_actions(rules: Mapping[tuple[str, str], set[str]]) -> dict[str, set[str]]:
    """The permissions by kind of entity; an action is three services and two topics."""
    actions = rules.get(("actions", "execute"), set())
    topics = {f"{name}/_action/{part}" for name in actions for part in ("feedback", "status")}
    services = {f"{name}/_action/{part}" for name in actions for part in ("send_goal", "cancel_goal", "get_result")}
    return {
        "publisher": rules.get(("topics", "publish"), set()) | topics,
        "subscriber": rules.get(("topics", "subscribe"), set()),
        "service": rules.get(("services", "reply"), set()) | services,
        "client": rules.get(("services", "request"), set()),
    }


def used(node: Node, name: str) -> dict[str, set[str]]:
    """The entities of a node, by kind."""
    found = {}
    for kind in ("publisher", "subscriber", "service", "client"):
        rows = getattr(node, f"get_{kind}_names_and_types_by_node")(name, "/")
        found[kind] = {topic for topic, _ in rows}
    return found


def test_the_policy_allows_exactly_what_each_node_uses(graph: Graph):
    """Introspection and simulated time are on, so their entities are included."""
    graph.change(Transition.TRANSITION_CONFIGURE)
    assert wait_until(lambda: graph.node.count_services("/predict_push") > 0)
    allowed = permissions()
    assert allowed.keys() == set(NODES.values())
    for name, rules in allowed.items():
        wanted = with_parts_of_actions(rules)
        wanted["subscriber"] -= set() if tf_is_there() else {"/tf", "/tf_static"}
        if name == "push_validator":  # it subscribes to /clock itself to date scalar topics
            assert "/clock" in wanted["subscriber"]
        if name == "push_replay":  # here nothing asks it for the time
            wanted["publisher"].remove("/clock")
        assert wait_until(lambda name=name, wanted=wanted: used(graph.node, name) == wanted, 30.0), (  # type: ignore[misc]  # bound at once
            name,
            {kind: names ^ wanted[kind] for kind, names in used(graph.node, name).items()},
        )


def tf_is_there() -> bool:
    return subprocess.run([sys.executable, "-c", "import tf2_ros"], capture_output=True).returncode == 0


def test_nodes_report_their_health_every_second_in_every_state(graph: Graph):
    """The fixture has waited for those of the states in which the nodes begin."""
    assert call(graph.node.create_client(Resume, "/push_replay/resume"), Resume.Request()) is not None
    assert_every_second(graph, "push_predictor", "inactive")
    assert_every_second(graph, "push_replay", "finished")
    assert_every_second(graph, "push_validator", "waiting for samples")
