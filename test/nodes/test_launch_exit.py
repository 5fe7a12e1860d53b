# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The choices of the launch files' arguments, and that a launch ends when a node that is needed ends."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from fake_launch import FakeAction, actions, install_fake_launch, install_fake_rviz, load_launch_file, started
from repository import REPOSITORY

from push_predictor.nodes.launch_files import end_launch
from push_predictor.nodes.parameter_tables import PUSH_VALIDATOR

MAIN = REPOSITORY / "launch" / "push_predictor.launch.py"
RECORD = REPOSITORY / "launch" / "record.launch.py"
ROS2 = "/opt/ros/jazzy/bin/ros2"


@pytest.fixture(autouse=True)
def launch_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    install_fake_launch(monkeypatch)


def run(
    file: Path, monkeypatch: pytest.MonkeyPatch, *words: str, given: dict[str, str] | None = None
) -> list[FakeAction]:
    """What `ros2 launch push_predictor FILE WORDS` starts."""
    monkeypatch.setattr(sys, "argv", [ROS2, "launch", "push_predictor", file.name, *words])
    arguments = given or dict(word.split(":=") for word in words)
    return started(load_launch_file(file), arguments, words)


@pytest.mark.parametrize(("file", "count"), [(MAIN, 4), (RECORD, 2)], ids=lambda value: getattr(value, "name", ""))
def test_a_switch_is_true_or_false(file: Path, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    declared = {a.args[0]: a.kwargs for a in actions(load_launch_file(file)) if "choices" in a.kwargs}
    switches = [name for name, kwargs in declared.items() if kwargs["default_value"] in ("true", "false")]
    assert len(switches) == count
    assert {declared[name]["choices"] for name in switches} == {("true", "false", "True", "False")}
    assert all(each["default_value"] in each["choices"] for each in declared.values() if each["choices"])
    words = [f"{name}:={value}" for name in switches for value in ("True", "False")]
    assert all("Node" in {type(action).__name__ for action in run(file, monkeypatch, word)} for word in words)


# --- the end of a node -----------------------------------------------------------------------------------------------


def exited(status: int, **context: Any) -> tuple[Any, Any]:
    event = SimpleNamespace(process_name="push_validator-2", returncode=status)
    return event, SimpleNamespace(**{"is_shutdown": False, **context})


@pytest.mark.parametrize("status", [1, 2, -9, -11, 130, -2])
def test_a_node_that_fails_ends_the_launch_with_a_status_other_than_0(status: int) -> None:
    for on_exit in (end_launch(), end_launch(also_if_done=False)):
        with pytest.raises(RuntimeError, match=f"push_validator-2 ended with status {status}"):
            on_exit(*exited(status))


def test_a_node_that_ends_by_itself_ends_the_launch_unless_the_others_go_on_without_it() -> None:
    ended = end_launch()(*exited(0))
    assert type(ended).__name__ == "Shutdown" and ended.kwargs["reason"] == "push_validator-2 has ended"
    assert end_launch(also_if_done=False)(*exited(0)) is None


@pytest.mark.parametrize("status", [0, 130, 143, -2, -15])
def test_nodes_that_end_on_a_signal_of_the_launch_have_not_failed(status: int) -> None:
    assert end_launch()(*exited(status, is_shutdown=True)) is None


@pytest.mark.parametrize("status", [1, -9])
def test_a_failure_at_the_end_is_shown_too(status: int) -> None:
    with pytest.raises(RuntimeError):
        end_launch()(*exited(status, is_shutdown=True))


def test_each_node_has_the_end_that_suits_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_fake_rviz(tmp_path, monkeypatch)
    found = {node.kwargs["executable"]: node.kwargs for node in run(MAIN, monkeypatch, "recording:=b", "rviz:=true")}
    (recorder,) = run(RECORD, monkeypatch, "bag:=b")
    assert "on_exit" not in found.pop("rviz2")  # its window may be closed
    for node in (found["predict_server"], found["push_validator"], recorder.kwargs):
        assert type(node["on_exit"](*exited(0))).__name__ == "Shutdown"
    assert found["push_replay"]["on_exit"](*exited(0)) is None
    for node in found.values():
        with pytest.raises(RuntimeError):
            node["on_exit"](*exited(1))


# --- live devices ----------------------------------------------------------------------------------------------------


def validator(monkeypatch: pytest.MonkeyPatch, *words: str) -> dict[str, Any]:
    found = {node.kwargs["executable"]: node.kwargs for node in run(MAIN, monkeypatch, *words)}
    return dict(found["push_validator"]["parameters"][-1])


def test_covariates_are_a_list_of_topics(monkeypatch: pytest.MonkeyPatch) -> None:
    given = validator(monkeypatch, "covariate_topics:=surface/temperature, /room/humidity,")
    assert given == {"covariate_topics": ["surface/temperature", "/room/humidity"]}
    (row,) = (row for row in PUSH_VALIDATOR if row.name == "covariate_topics")
    assert row.allows(given["covariate_topics"])
    assert validator(monkeypatch) == {}


def test_the_reliability_is_that_of_every_sensor_topic_by_its_full_name(monkeypatch: pytest.MonkeyPatch) -> None:
    words = ("reliability:=best_effort", "namespace:=/cell", "slider_topic:=/vrpn/block/pose", "pusher_topic:=/tf:tip")
    given = validator(monkeypatch, *words, "wrench_topic:=ft.data.wrench")
    assert {name: value for name, value in given.items() if name.startswith("qos")} == {
        "qos_overrides./vrpn/block/pose.subscription.reliability": "best_effort",
        "qos_overrides./cell/ft.subscription.reliability": "best_effort",
    }
    default = validator(monkeypatch, "reliability:=reliable")
    assert default["qos_overrides./slider/pose.subscription.reliability"] == "reliable"
    assert load_launch_file(MAIN)["CHOICES"]["reliability"] == ("", "reliable", "best_effort")
