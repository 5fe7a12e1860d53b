# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The launch files start the nodes with parameters that they declare, and end when a node that is needed ends.

Substitutes replace launch and launch_ros, and the tests check what the files pass to them.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from fake_launch import actions, install_fake_launch, load_launch_file, started
from repository import REPOSITORY

from push_predictor.nodes import parameter_tables
from push_predictor.nodes.launch_files import end_launch
from push_predictor.resources import DEFAULT_MODEL, SHIPPED, share_path

FILES = {name: REPOSITORY / "launch" / f"{name}.launch.py" for name in ("push_predictor", "record")}
PARAMETERS = {
    "predict_server": parameter_tables.PREDICT_SERVER,
    "push_recorder": parameter_tables.PUSH_RECORDER,
    "push_replay": parameter_tables.PUSH_REPLAY,
    "push_validator": parameter_tables.PUSH_VALIDATOR,
}
LABORATORY = {
    "slider_topic": "/vicon/block/block",
    "pusher_topic": "/tf:tool0",
    "wrench_topic": "/ft",
    "world_frame": "map",
}


@pytest.fixture(autouse=True)
def launch_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    install_fake_launch(monkeypatch)


def nodes(file: str = "push_predictor", **given: str) -> dict[str, dict[str, Any]]:
    """The arguments of each node for these launch arguments, by executable; each accepts the parameters it gets."""
    launch_file = load_launch_file(FILES[file])
    assert given.keys() <= {name for name, _, _ in launch_file["ARGUMENTS"]}
    found = {node.kwargs["executable"]: node.kwargs for node in started(launch_file, given)}
    for executable, node in found.items():
        table = {row.name: row for row in PARAMETERS.get(executable, ())}
        for name, value in parameters(node).items():
            ours = executable in PARAMETERS and name != "use_sim_time" and not name.startswith("qos_overrides")
            assert not ours or table[name].allows(value), f"{executable}: {name} = {value!r}"
    return found


def parameters(node: dict[str, Any]) -> dict[str, Any]:
    return dict(node["parameters"][-1])


def described(file: str, kind: str) -> list[Any]:
    return [action for action in actions(load_launch_file(FILES[file])) if type(action).__name__ == kind]


# --- arguments -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("file", "switches"), [("push_predictor", 4), ("record", 2)])
def test_every_argument_has_a_description_and_a_switch_is_true_or_false(file: str, switches: int) -> None:
    found = 0
    for kwargs in (action.kwargs for action in described(file, "DeclareLaunchArgument")):
        assert isinstance(kwargs["default_value"], str) and kwargs["description"]
        assert not kwargs["choices"] or kwargs["default_value"] in kwargs["choices"]
        if kwargs["default_value"] in ("true", "false"):
            assert kwargs["choices"] == ("true", "false", "True", "False")
            found += 1
    assert found == switches


@pytest.mark.parametrize(("outside", "inside"), [(None, "LOCALHOST"), ("SUBNET", "SUBNET")])
def test_discovery_is_limited_to_this_machine_unless_the_environment_sets_it(
    outside: str | None, inside: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE", raising=False)
    if outside:
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", outside)
    (setting,) = described("push_predictor", "SetEnvironmentVariable")
    assert setting.args == ("ROS_AUTOMATIC_DISCOVERY_RANGE", inside)


def test_three_nodes_start_with_their_parameters() -> None:
    given = {"model": "m.pushmodel", "output": "~/result", "rig": "a.rig.yaml", "rate": "10", **LABORATORY}
    running = nodes(recording="bags/x", **given)
    here, home = str(Path.cwd()), str(Path.home())
    rig = {"rig": f"{here}/a.rig.yaml"}
    assert parameters(running["predict_server"]) == {"models": [f"{here}/m.pushmodel"]}
    paths = {"model": f"{here}/m.pushmodel", "output": f"{home}/result", **rig}
    assert parameters(running["push_validator"]) == {**paths, **LABORATORY}
    replay = {"recording": f"{here}/bags/x", "play.rate": 10.0, **rig, **LABORATORY}
    assert parameters(running["push_replay"]) == replay
    assert running["push_replay"]["arguments"][3:] == ["-p", "wait_for_subscribers:=30.0"]


def test_a_file_of_parameters_comes_before_given_arguments_and_after_what_the_launch_sets_for_a_replay() -> None:
    """In ROS the later of two sources wins, so an argument that was not given must not be passed at all."""
    given = nodes(recording="/b", params_file="/p.yaml", use_sim_time="true")
    for executable, node in given.items():
        own = {"recording": "/b"} if executable == "push_replay" else {}
        assert node["parameters"] == ["/p.yaml", {"use_sim_time": True, **own}]
    assert "play.clock_publish_frequency:=40.0" in given["push_replay"]["arguments"]
    assert nodes("record", params_file="/p.yaml")["push_recorder"]["parameters"] == ["/p.yaml", {}]
    switched = nodes(autostart="False", adapt="true")["predict_server"]
    assert parameters(switched) == {"autostart": False, "adapt": True}


def test_default_is_the_shipped_model_for_server_and_validator_and_there_is_no_replay_without_a_recording() -> None:
    running = nodes(model="default")
    assert parameters(running.pop("predict_server")) == {"models": [SHIPPED]}
    assert parameters(running.pop("push_validator")) == {"model": share_path(*DEFAULT_MODEL).stem}
    assert not running


def test_covariates_are_a_list_of_topics() -> None:
    given = nodes(covariate_topics="surface/temperature, /room/humidity,")["push_validator"]
    assert parameters(given) == {"covariate_topics": ["surface/temperature", "/room/humidity"]}


def test_the_reliability_is_that_of_every_sensor_topic_by_its_full_name() -> None:
    topics = {"slider_topic": "/vrpn/block/pose", "pusher_topic": "/tf:tip", "wrench_topic": "ft.data.wrench"}
    given = parameters(nodes(reliability="best_effort", namespace="/cell", **topics)["push_validator"])
    assert {name: value for name, value in given.items() if name.startswith("qos")} == {
        "qos_overrides./vrpn/block/pose.subscription.reliability": "best_effort",
        "qos_overrides./cell/ft.subscription.reliability": "best_effort",
    }
    default = parameters(nodes(reliability="reliable")["push_validator"])
    assert default["qos_overrides./slider/pose.subscription.reliability"] == "reliable"
    assert load_launch_file(FILES["push_predictor"])["CHOICES"]["reliability"] == ("", "reliable", "best_effort")


def test_the_recorder_gets_what_was_given() -> None:
    given = {"bag": "monday", "rig": "~/rig.yaml", "slider_topic": "/tf:block", "duration": "60", "force": "true"}
    (node,) = nodes("record", covariate_topics="/warmth, /driver.x", use_sim_time="true", **given).values()
    assert parameters(node) == {
        "bag": str(Path.cwd() / "monday"),
        "rig": str(Path.home() / "rig.yaml"),
        "slider_topic": "/tf:block",
        "covariate_topics": ["/warmth", "/driver.x"],
        "duration": 60.0,
        "force": True,
        "use_sim_time": True,
    }


# --- nodes -----------------------------------------------------------------------------------------------------------


def test_executables_are_installed_under_their_node_names_and_run_in_their_enclaves_of_the_policy() -> None:
    policy = ET.parse(REPOSITORY / "config" / "sros2_policy.xml").getroot()
    common = {"namespace": "cell", "log_level": "debug"}
    running = nodes(recording="bags/x", enclaves="/push_predictor/", **common)
    running |= nodes("record", enclave="/push_predictor/push_recorder", **common)
    names = {executable: node["name"] for executable, node in running.items()}
    assert names.pop("predict_server") == "push_predictor" and all(name == own for name, own in names.items())
    for executable, node in running.items():
        assert (REPOSITORY / "scripts" / "run" / executable).exists()
        assert (node["package"], node["namespace"]) == ("push_predictor", "cell")
        assert node["arguments"][:3] == ["--ros-args", "--log-level", "debug"]
        assert node["arguments"][-2:] == ["--enclave", f"/push_predictor/{executable}"]
    assert {node["arguments"][-1] for node in running.values()} == {e.attrib["path"] for e in policy.iter("enclave")}


@pytest.fixture
def rviz_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = tmp_path / "share" / "ament_index" / "resource_index" / "packages" / "rviz2"
    entry.parent.mkdir(parents=True)
    entry.touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))


def test_rviz_that_is_not_installed_is_named_with_its_apt_package(monkeypatch: pytest.MonkeyPatch) -> None:
    for prefixes in ("/nowhere", ""):
        monkeypatch.setenv("AMENT_PREFIX_PATH", prefixes)
        message = "rviz:=true needs rviz2, which is not installed: sudo apt install ros-jazzy-rviz2"
        with pytest.raises(RuntimeError, match=message):
            nodes(rviz="true")
        assert "rviz2" not in nodes()


def test_rviz_is_optional_and_uses_the_installed_configuration(rviz_installed: None) -> None:
    rviz = nodes(rviz="true", namespace="cell", use_sim_time="true")["rviz2"]
    assert (rviz["package"], rviz["namespace"], parameters(rviz)) == ("rviz2", "cell", {"use_sim_time": True})
    flag, config = rviz["arguments"]
    assert (flag, Path(config)) == ("-d", REPOSITORY / "config" / "push_predictor.rviz") and Path(config).exists()
    own = nodes(rviz="True", rviz_config="own.rviz")["rviz2"]
    assert own["arguments"] == ["-d", str(Path.cwd() / "own.rviz")]


# --- the end of a node -----------------------------------------------------------------------------------------------


def exited(status: int, is_shutdown: bool = False) -> tuple[Any, Any]:
    event = SimpleNamespace(process_name="push_validator-2", returncode=status)
    return event, SimpleNamespace(is_shutdown=is_shutdown)


@pytest.mark.parametrize(
    ("status", "is_shutdown"), [*((status, False) for status in (1, 2, -9, -11, 130, -2)), (1, True), (-9, True)]
)
def test_a_node_that_fails_ends_the_launch_with_a_status_other_than_0(status: int, is_shutdown: bool) -> None:
    for on_exit in (end_launch(), end_launch(also_if_done=False)):
        with pytest.raises(RuntimeError, match=f"push_validator-2 ended with status {status}"):
            on_exit(*exited(status, is_shutdown))


@pytest.mark.parametrize("status", [0, 130, 143, -2, -15])
def test_nodes_that_end_on_a_signal_of_the_launch_have_not_failed(status: int) -> None:
    assert end_launch()(*exited(status, is_shutdown=True)) is None


def test_the_end_of_a_node_ends_the_launch_unless_the_others_go_on_without_it(rviz_installed: None) -> None:
    found = nodes(recording="b", rviz="true") | nodes("record", bag="b")
    assert "on_exit" not in found.pop("rviz2"), "its window may be closed"
    assert found.pop("push_replay")["on_exit"](*exited(0)) is None
    for node in found.values():
        ended = node["on_exit"](*exited(0))
        assert type(ended).__name__ == "Shutdown" and ended.kwargs["reason"] == "push_validator-2 has ended"
