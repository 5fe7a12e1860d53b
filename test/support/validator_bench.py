# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Validator and replay as processes, their diagnostics, and checks of their results."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from hosted_nodes import HostedNode, hosted_node
from rclpy.node import Node
from ros_harness import REPOSITORY, START_TIMEOUT, NodeProcess, acquaint, call, node_process, wait_until
from std_srvs.srv import Trigger
from synthetic import rows, wrench_rows

from push_predictor.evaluation.offline import validate_recording
from push_predictor.evaluation.validation import metrics_json
from push_predictor.models.store.model_file import load_model
from push_predictor.nodes import push_replay
from push_predictor.online import check_process
from push_predictor.online.alarm_process import AlarmProcess
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import taken
from push_predictor.recordings.write import write_recording
from push_predictor_interfaces.srv import Burst

HEXAGON = REPOSITORY / "bags" / "hexagon_delrin"  # 10 pushes, 21 s
CIRCLE = REPOSITORY / "bags" / "circle_pu"
PLAYING_ALONE = ("-r", "replay_status:=nowhere")  # of a replay or validator: as if another program played
WRITTEN = "Validation written"
NO_SERVER = "No node offers predict_push"


@contextmanager
def replaying(
    domain: int, *ros_args: str, recording: Path = HEXAGON, rate: float = 10.0, **more: Any
) -> Iterator[NodeProcess]:
    """Run push_replay, which waits for subscribers."""
    with node_process("push_replay", *ros_args, domain=domain, params=_of_replay(recording, rate, more)) as process:
        yield process


@contextmanager
def hosting_replay(
    domain: int, *ros_args: str, recording: Path = HEXAGON, rate: float = 10.0, **more: Any
) -> Iterator[HostedNode]:
    """The same in this process, without the check of the recording: both take a second of processor time."""
    params = _of_replay(recording, rate, more)
    unchecked = patch.object(push_replay, "LARGEST_CHECKED", 0)
    with unchecked, hosted_node("push_replay", *ros_args, domain=domain, params=params) as node:
        yield node


@contextmanager
def hosting_validator(*ros_args: str, **where: Any) -> Iterator[HostedNode]:
    """push_validator in this process, without the processes of its alarm and its check of the samples.

    Each takes a second of processor time. where: as `hosted_node` has it.
    """
    with (
        patch.object(AlarmProcess, "prepare"),
        patch.object(check_process, "FIRST", sys.maxsize),
        hosted_node("push_validator", *ros_args, **where) as node,
    ):
        yield node


def _of_replay(recording: Path, rate: float, more: dict[str, Any]) -> dict[str, Any]:
    return {"recording": recording, "play.rate": rate, "wait_for_subscribers": 60.0, **more}


def beginning(source: Path, seconds: float, path: Path) -> Path:
    """Write the first seconds of a recording to a folder `path`; returns it."""
    recording = read_recording(source)
    assert recording.wrench is not None
    slider, pusher, wrench = recording.slider, recording.pusher, recording.wrench
    end = slider.stamp[0] + round(seconds * 1e9)
    streams = {"slider": rows(slider, slider.stamp < end), "pusher": rows(pusher, pusher.stamp < end)}
    scalars = {name: taken(stream, stream.stamp < end) for name, stream in recording.scalars.items()}
    wrench = wrench_rows(wrench, wrench.stamp < end)
    write_recording(path, replace(recording, **streams, wrench=wrench, scalars=scalars))
    return path


def play_some(node: Node, messages: int) -> None:
    """Let a paused replay publish its next messages, once its subscribers are there."""
    client = node.create_client(Burst, "push_replay/burst")
    acquaint(node, "push_replay")  # a repeated call would publish twice as many
    request = Burst.Request(num_messages=messages)
    assert wait_until(lambda: call(client, request).actually_burst == messages), "0 until it has subscribers"
    node.destroy_client(client)


class Status:
    """All statuses of a node on /diagnostics, in order."""

    def __init__(self, node: Node, name: str = "push_validator") -> None:
        self._name = name
        self.identity = ("", "")  # name and hardware_id of the last one
        self.all: list[tuple[bytes, str, dict[str, str]]] = []
        node.create_subscription(DiagnosticArray, "/diagnostics", self._receive, 100)

    def wait_for_first(self) -> None:
        """Wait for the first status; by then the node has discovered this listener, which takes DDS up to 3 s."""
        assert wait_until(lambda: bool(self.all)), f"nothing on /diagnostics of {self._name}"

    def wait_for_server(self) -> None:
        """Wait until the node has discovered a server: a late one would answer all requests in one burst."""
        found = wait_until(lambda: bool(self.all) and NO_SERVER not in self.message)
        assert found, f"no server found: {self.all[-1:]}"

    def wait_for_news(self) -> None:
        """Wait for values from after this call; the first status may have been sent before it."""
        known = len(self.all)
        assert wait_until(lambda: len(self.all) > known + 1), f"no more on /diagnostics of {self._name}"

    def _receive(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if self._name in status.name:
                self.identity = status.name, status.hardware_id
                self.all.append((status.level, status.message, {v.key: v.value for v in status.values}))

    @property
    def message(self) -> str:
        return self.all[-1][1] if self.all else ""

    @property
    def values(self) -> dict[str, str]:
        return self.all[-1][2] if self.all else {}

    def wait_for(self, key: str, value: str, timeout: float = START_TIMEOUT) -> None:
        assert wait_until(lambda: self.values.get(key) == value, timeout), f"{key} is not {value}: {self.all[-1:]}"

    def wait_for_message(self, text: str, timeout: float = START_TIMEOUT) -> str:
        assert wait_until(lambda: text in self.message, timeout), f"no {text!r} in {self.all[-1:]}"
        return self.message


def windows_of(folder: Path, suffix: str = "") -> list[dict[str, Any]]:
    return list(json.loads((folder / f"windows{suffix}.json").read_text())["windows"])


def assert_same_as_offline(folder: Path, model: Path, recording: Path = HEXAGON, suffix: str = "") -> None:
    """Assert the windows of an offline validation, its predictions to 1e-9 and its metrics to rounding."""
    windows, comparison = validate_recording(load_model(model), recording)
    online = windows_of(folder, suffix)
    found, expected = [(w["push_id"], w["window"]) for w in online], [(w.push_id, w.index) for w in windows]
    assert found == expected, f"missing {sorted({*expected} - {*found})}, too many {sorted({*found} - {*expected})}"
    assert [(w["start"], w["end"]) for w in online] == [(w.start, w.end) for w in windows]
    predicted = np.array([w["predicted"] for w in online])
    assert np.max(np.abs(predicted - comparison.mean)) < 1e-9
    covariance = np.array([w["covariance"] for w in online]).reshape(-1, 3, 3)
    assert np.max(np.abs(covariance - comparison.covariance)) < 1e-9
    result = json.loads((folder / f"validation{suffix}.json").read_text())
    if not suffix:
        assert "fired" in result.pop("alarm")
    assert_same_figures(result, metrics_json(comparison))


def assert_same_figures(found: Any, expected: Any) -> None:
    """Assert equal keys and texts, and numbers equal to a relative 1e-6."""
    if isinstance(expected, dict):
        assert found.keys() == expected.keys()
        for key in expected:
            assert_same_figures(found[key], expected[key])
    elif isinstance(expected, float):
        assert abs(found - expected) <= 1e-6 * max(1.0, abs(expected))
    else:
        assert found == expected


def finish(node: Node, name: str = "push_validator/finish", timeout: float = START_TIMEOUT) -> Trigger.Response:
    client = node.create_client(Trigger, name)
    try:
        return call(client, Trigger.Request(), timeout)
    finally:
        node.destroy_client(client)
