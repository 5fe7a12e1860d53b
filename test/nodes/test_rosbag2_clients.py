# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_replay answers clients of both types under one name: rosbag2's, and this project's."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from replay_bags import START, push_messages, write_bag
from ros_harness import REPOSITORY, free_domain, node_environment, node_process
from standard_interfaces import provide_interfaces

PLAYER = "/cell/rosbag2_player"
LATE = {"sec": START // 10**9 + 4, "nanosec": 0}
# A session of a rosbag2 client: service, request, expected answer.
SESSION: tuple[tuple[str, dict[str, Any], dict[str, Any]], ...] = (
    ("is_paused", {}, {"paused": True}),
    ("get_rate", {}, {"rate": 1.0}),
    ("set_rate", {"rate": -1.0}, {"success": False}),
    ("set_rate", {"rate": 2.0}, {"success": True}),
    ("play_next", {}, {"success": True}),
    ("burst", {"num_messages": 3}, {"actually_burst": 3}),
    ("play", {}, {"success": False}),  # a playback is under way
    ("resume", {}, {}),
    ("pause", {}, {}),
    ("toggle_paused", {}, {}),
    ("toggle_paused", {}, {}),
    ("is_paused", {}, {"paused": True}),
    ("seek", {"time": LATE}, {"success": True}),
    ("stop", {}, {}),
)


@pytest.fixture
def interfaces(monkeypatch: pytest.MonkeyPatch) -> None:
    """rosbag2_interfaces for the processes: installed, or in the folder PUSH_PREDICTOR_ROSBAG2_INTERFACES."""
    provide_interfaces("rosbag2_interfaces", monkeypatch)


def test_a_client_of_rosbag2_controls_the_player(tmp_path: Path, interfaces: None) -> None:
    bag, domain = write_bag(tmp_path / "bag.mcap", push_messages(10.0)), free_domain()
    params = {"recording": bag, "play.start_paused": True}
    renamed = ("-r", "__node:=rosbag2_player")
    with node_process("push_replay", *renamed, domain=domain, namespace="/cell", params=params) as process:
        assert session(domain) == [expected for _, _, expected in SESSION]
        assert process.stop() == 0 and "Traceback" not in process.text(), process.text()


def session(domain: int) -> list[dict[str, Any]]:
    """The answers to a client in a process of its own, which has only rosbag2's types."""
    words = [f"{name}:{json.dumps(request)}" for name, request, _ in SESSION]
    script = REPOSITORY / "test/support/rosbag2_client.py"
    done = subprocess.run(
        [sys.executable, str(script), PLAYER, *words],
        env=node_environment(domain),
        check=True,
        capture_output=True,
        text=True,
        timeout=180.0,
    )
    answers: list[dict[str, Any]] = json.loads(done.stdout)
    return answers
