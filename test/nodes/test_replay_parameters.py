# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of push_replay: refused values, and the shipped configuration."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from replay_bags import push_messages, write_bag
from ros_harness import free_domain

from push_predictor.nodes import runtime
from push_predictor.nodes.push_replay import PushReplay


@pytest.fixture(scope="module")
def second(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bag(tmp_path_factory.mktemp("bags") / "second.mcap", push_messages(1.0))


@pytest.mark.parametrize(
    ("params", "text"),
    [
        ({}, "recording: '' is not accepted"),
        ({"recording": "/nowhere.mcap"}, "/nowhere.mcap: cannot be read"),
        ({"play.rate": -1.0}, "play.rate: -1.0 is not accepted, give a number from 1e-06 up to 1e+06"),
        ({"play.rate": "fast"}, "play.rate: 'fast' is not accepted"),
        ({"play.delay": -1.0}, "play.delay: -1.0 is not accepted, give 0 s or more"),
        ({"play.read_ahead_queue_size": 0}, "play.read_ahead_queue_size: 0 is not accepted"),
        ({"play.regex_to_filter": "("}, "play.regex_to_filter: '(' is not accepted"),
        ({"restamp": True, "play.rate": 2.0}, "play.rate: 2.0 is not accepted"),
        ({"rig": "/nowhere.yaml"}, "/nowhere.yaml: the rig cannot be read"),
        ({"play.qos_profile_overrides_path": "/nowhere.yaml"}, "play.qos_profile_overrides_path: '/nowhere.yaml'"),
        ({"qos_overrides./slider/pose.publisher.reliability": "perhaps"}, "reliability"),
        ({"play.nonsense": 1}, "play.nonsense: 1 is not accepted"),
        ({"play.delay": 1.0, "play.delay.nsec": 5}, "play.delay: 1.0 is not accepted, give either play.delay in"),
        ({"storage.uri": "/other.mcap"}, "storage.uri: '/other.mcap' is not accepted, give one recording"),
        (
            {"storage.storage_id": "sqlite3"},
            "storage.storage_id: 'sqlite3' is not accepted, give 'mcap', the format of",
        ),
    ],
)
def test_bad_parameter_ends_in_one_line_and_status_1(
    second: Path,
    params: dict[str, Any],
    text: str,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """In this process, whose signal handlers are kept."""
    monkeypatch.setattr(runtime, "_handle_signals", lambda stop: None)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(free_domain()))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    given = {"recording": str(second), **params} if params else {}
    words = [word for name, value in given.items() for word in ("-p", f"{name}:={json.dumps(value)}")]
    assert runtime.run("push_replay", PushReplay, ["--ros-args", *words]) == 1
    assert_one_line(capfd.readouterr().err, text)


def assert_one_line(printed: str, text: str) -> None:
    lines = printed.splitlines()
    assert len(lines) == 1, lines
    assert lines[0].startswith("push_replay: ")
    assert text in lines[0]
