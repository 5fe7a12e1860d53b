# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The launch files start the nodes with parameters that they declare.

Substitutes replace launch and launch_ros, and the tests check what the files pass to them.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
from fake_launch import actions, install_fake_launch, install_fake_rviz, load_launch_file, started
from ros_harness import REPOSITORY

from push_predictor.nodes import parameter_tables
from push_predictor.resources import DEFAULT_MODEL, SHIPPED, share_path

FILE = REPOSITORY / "launch" / "push_predictor.launch.py"
RECORD = REPOSITORY / "launch" / "record.launch.py"
PARAMETERS = {
    "predict_server": parameter_tables.PREDICT_SERVER,
    "push_recorder": parameter_tables.PUSH_RECORDER,
    "push_replay": parameter_tables.PUSH_REPLAY,
    "push_validator": parameter_tables.PUSH_VALIDATOR,
}


@pytest.fixture
def launch_file(launch_packages: None) -> dict[str, Any]:
    """The names that the launch file defines."""
    return load_launch_file(FILE)


@pytest.fixture
def record_file(launch_packages: None) -> dict[str, Any]:
    return load_launch_file(RECORD)


@pytest.fixture
def launch_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    install_fake_launch(monkeypatch)


def nodes(launch_file: dict[str, Any], **given: str) -> dict[str, dict[str, Any]]:
    """The arguments of each node for these launch arguments, by executable."""
    assert given.keys() <= {name for name, _, _ in launch_file["ARGUMENTS"]}
    return {node.kwargs["executable"]: node.kwargs for node in started(launch_file, given)}


def parameters(node: dict[str, Any]) -> dict[str, Any]:
    return dict(node["parameters"][-1])


def test_every_argument_is_declared_with_a_default_and_a_description(launch_file):
    declared = {a.args[0]: a.kwargs for a in actions(launch_file) if type(a).__name__ == "DeclareLaunchArgument"}
    assert len(declared) > 20
    for kwargs in declared.values():
        assert isinstance(kwargs["default_value"], str) and kwargs["description"]


@pytest.mark.parametrize(("outside", "inside"), [(None, "LOCALHOST"), ("SUBNET", "SUBNET")])
def test_discovery_is_limited_to_this_machine_unless_the_environment_sets_it(
    outside: str | None, inside: str, launch_file, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE", raising=False)
    if outside:
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", outside)
    (setting,) = (action for action in actions(launch_file) if type(action).__name__ == "SetEnvironmentVariable")
    assert setting.args == ("ROS_AUTOMATIC_DISCOVERY_RANGE", inside)


def test_validator_and_replay_get_the_topics_of_a_laboratory(launch_file):
    given = {
        "slider_topic": "/vicon/block/block",
        "pusher_topic": "/tf:tool0",
        "wrench_topic": "/ft",
        "world_frame": "map",
    }
    assert parameters(nodes(launch_file, **given)["push_validator"]) == given
    assert given.keys().isdisjoint(parameters(nodes(launch_file)["push_validator"]))
    replay = parameters(nodes(launch_file, recording="bags/x", **given)["push_replay"])
    assert {name: replay[name] for name in given} == given
    assert given.keys().isdisjoint(parameters(nodes(launch_file, recording="bags/x")["push_replay"]))


def test_three_nodes_start_with_their_parameters(launch_file):
    given = {"model": "m.pushmodel", "output": "~/result", "rig": "a.rig.yaml", "rate": "10"}
    running = nodes(launch_file, recording="bags/x", **given)
    here, home = str(Path.cwd()), str(Path.home())
    assert parameters(running["predict_server"]) == {"models": [f"{here}/m.pushmodel"]}
    assert parameters(running["push_validator"]) == {
        "model": f"{here}/m.pushmodel",
        "output": f"{home}/result",
        "rig": f"{here}/a.rig.yaml",
    }
    assert parameters(running["push_replay"]) == {
        "recording": f"{here}/bags/x",
        "rig": f"{here}/a.rig.yaml",
        "play.rate": 10.0,
    }
    assert running["push_replay"]["arguments"][3:] == ["-p", "wait_for_subscribers:=30.0"]


def test_a_file_of_parameters_overrides_what_the_launch_sets_for_a_replay(launch_file):
    """Arguments come before the file, as rcl's last value counts; parameters of the launch come after it."""
    replay = nodes(launch_file, recording="bags/x", use_sim_time="true", params_file="/p.yaml")["push_replay"]
    assert "play.clock_publish_frequency:=40.0" in replay["arguments"]
    assert replay["parameters"][0] == "/p.yaml" and "play.clock_publish_frequency" not in parameters(replay)


def test_default_is_the_shipped_model_for_server_and_validator(launch_file):
    running = nodes(launch_file, model="default")
    assert parameters(running["predict_server"]) == {"models": [SHIPPED]}
    assert parameters(running["push_validator"]) == {"model": share_path(*DEFAULT_MODEL).stem}


def test_nodes_declare_and_accept_every_parameter(launch_file):
    given = {"recording": "bags/x", "model": "m", "output": "o", "rig": "r", "rate": "2.5"}
    given |= {"autostart": "false", "use_sim_time": "true"}
    for executable, node in nodes(launch_file, **given).items():
        table = {row.name: row for row in PARAMETERS[executable]}
        values = parameters(node)
        assert values.pop("use_sim_time") is True
        for name, value in values.items():
            assert table[name].allows(value), f"{executable}: {name} = {value!r}"


def test_executables_are_installed_under_their_node_names(launch_file):
    running = nodes(launch_file, recording="bags/x", namespace="cell", log_level="debug")
    names = {"predict_server": "push_predictor", "push_validator": "push_validator", "push_replay": "push_replay"}
    assert {executable: node["name"] for executable, node in running.items()} == names
    for executable, node in running.items():
        assert (REPOSITORY / "scripts" / "run" / executable).exists()
        assert (node["package"], node["namespace"]) == ("push_predictor", "cell")
        assert node["arguments"][:3] == ["--ros-args", "--log-level", "debug"]


def test_nodes_run_in_their_enclaves_of_the_policy(launch_file, record_file):
    policy = ET.parse(REPOSITORY / "config" / "sros2_policy.xml").getroot()
    enclaves = {enclave.attrib["path"] for enclave in policy.iter("enclave")}
    running = nodes(launch_file, recording="bags/x", enclaves="/push_predictor/")
    recorder = nodes(record_file, enclave="/push_predictor/push_recorder")["push_recorder"]
    assert {node["arguments"][-1] for node in [*running.values(), recorder]} == enclaves
    for executable, node in running.items():
        assert node["arguments"][-2:] == ["--enclave", f"/push_predictor/{executable}"]


def test_no_replay_without_a_recording(launch_file):
    assert "push_replay" not in nodes(launch_file, model="m")
    assert parameters(nodes(launch_file, recording="/b")["push_replay"])["recording"] == "/b"


def test_parameter_file_applies_where_no_argument_is_given(launch_file):
    """In ROS the later of two sources wins, so an argument that was not given must not be passed at all."""
    for node in nodes(launch_file, params_file="/p.yaml", recording="/b").values():
        assert node["parameters"][0] == "/p.yaml"
        assert not {"autostart", "adapt", "use_sim_time", "play.rate"} & parameters(node).keys()
    assert parameters(nodes(launch_file, autostart="false")["predict_server"]) == {"autostart": False}
    assert parameters(nodes(launch_file, adapt="true")["predict_server"]) == {"adapt": True}


def test_rviz_is_optional_and_uses_the_installed_configuration(
    launch_file, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    install_fake_rviz(tmp_path, monkeypatch)
    assert "rviz2" not in nodes(launch_file, recording="/b")
    running = nodes(launch_file, recording="/b", rviz="true", namespace="cell", use_sim_time="true")
    assert {"predict_server", "push_validator", "push_replay", "rviz2"} == running.keys()
    rviz = running["rviz2"]
    assert (rviz["package"], rviz["namespace"], parameters(rviz)) == ("rviz2", "cell", {"use_sim_time": True})
    flag, config = rviz["arguments"]
    assert (flag, Path(config)) == ("-d", REPOSITORY / "config" / "push_predictor.rviz") and Path(config).exists()
    own = nodes(launch_file, rviz="True", rviz_config="own.rviz")["rviz2"]
    assert own["arguments"] == ["-d", str(Path.cwd() / "own.rviz")]


def test_the_recorder_gets_what_was_given_and_nothing_else(record_file):
    given = {
        "bag": "monday",
        "rig": "~/rig.yaml",
        "slider_topic": "/tf:block",
        "covariate_topics": "/warmth, /driver.x",
    }
    (node,) = nodes(record_file, **given, duration="60", use_sim_time="true", namespace="cell").values()
    assert (node["executable"], node["name"], node["namespace"]) == ("push_recorder", "push_recorder", "cell")
    assert (REPOSITORY / "scripts" / "run" / "push_recorder").exists()
    assert parameters(node) == {
        "bag": str(Path.cwd() / "monday"),
        "rig": str(Path.home() / "rig.yaml"),
        "slider_topic": "/tf:block",
        "covariate_topics": ["/warmth", "/driver.x"],
        "duration": 60.0,
        "use_sim_time": True,
    }
    table = {row.name: row for row in PARAMETERS["push_recorder"]}
    values = parameters(nodes(record_file, **given, force="true", duration="2.5")["push_recorder"])
    assert values["force"] is True and all(table[name].allows(value) for name, value in values.items())
    plain = nodes(record_file, params_file="/p.yaml")["push_recorder"]
    assert plain["parameters"] == ["/p.yaml", {}]
