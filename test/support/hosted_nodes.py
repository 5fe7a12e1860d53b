# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes in the test's own process, with their real start, executor, middleware and end.

A process of its own takes a second of processor time: it is for tests of signals, of files and of what several nodes
do together.
"""

from __future__ import annotations

import os
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from rclpy import utilities
from rclpy.context import Context
from ros_harness import START_TIMEOUT, free_domain, keep_tables, node_arguments, wait_until

from push_predictor.nodes import runtime
from push_predictor.nodes.predict_server import PredictServer
from push_predictor.nodes.push_recorder import PushRecorder
from push_predictor.nodes.push_replay import PushReplay
from push_predictor.nodes.push_validator import PushValidator
from push_predictor.nodes.runtime import Life, Stop
from push_predictor.resources import share_path

# As main() of a replay. Fast DDS reads it once: it counts only where no other node came first in this process.
PROFILES = {"FASTRTPS_DEFAULT_PROFILES_FILE": str(share_path("config", "fastdds_replay.xml"))}
NODES: dict[str, tuple[Any, Mapping[str, str]]] = {
    "predict_server": (lambda stop: PredictServer(), {}),
    "push_recorder": (PushRecorder, {}),
    "push_replay": (PushReplay, PROFILES),
    "push_validator": (lambda stop: PushValidator(), {}),
}
_LOGS: list[Path] = []  # of the nodes hosted now; one that is hosted meanwhile logs where the other does


class HostedNode:
    """A node that a thread of this process spins; what ROS logs goes to a file."""

    def __init__(self, life: Life, stop: Stop, log: Path, context: Context) -> None:
        self._life, self._stop, self._log = life, stop, log
        self._status: int | None = None
        self._begin, self._thread = log.stat().st_size, threading.Thread(target=life.spin, name="executor")
        self.pid = os.getpid()
        with _default(context):
            self._thread.start()
            wait_until(lambda: life.spinning or not self._thread.is_alive(), 10.0 * START_TIMEOUT)

    def text(self) -> str:
        """Everything logged since its start, also by nodes that are hosted meanwhile.

        Of a fixture: until its end only, as pytest redirects the log of each test.
        """
        return self._log.read_bytes()[self._begin :].decode(errors="replace")

    def wait_for_text(self, text: str, timeout: float = START_TIMEOUT) -> str:
        """Wait until it has logged `text`; returns everything logged. Raises AssertionError otherwise."""
        assert wait_until(lambda: text in self.text(), timeout), f"{text!r} was not logged:\n{self.text()}"
        return self.text()

    def stop(self) -> int:
        """End the node as by its own request; returns the status that its process would have."""
        if self._status is None:
            self._stop.request()
            self._thread.join()
            self._status = self._life.end()
        return self._status


@contextmanager
def hosted_node(
    executable: str, *ros_args: str, domain: int, namespace: str | None = None, params: Mapping[str, Any] | None = None
) -> Iterator[HostedNode]:
    """As `node_process`. Leaving ends the node, and raises what made it fail. It is ready when the block begins."""
    make_node, environment = NODES[executable]
    if executable == "predict_server":
        keep_tables(params)
    environment = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", **environment}
    stop, arguments = Stop(), ["--ros-args", *node_arguments(*ros_args, namespace=namespace, params=params)]
    with _stderr_in_file() as log, patch.dict(os.environ, environment):
        context = Context()
        node = HostedNode(Life(executable, make_node, stop, arguments, context), stop, log, context)
        try:
            yield node
        finally:
            assert node.stop() == 0, log.read_text()


def refused_start(
    start: Callable[[list[str]], int],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    *ros_args: str,
    **params: Any,
) -> str:
    """The one line on stderr of a node that does not start, with status 1. This process keeps its signal handlers.

    start: as main() of a node, from its arguments. params: names with `__` for a dot.
    """
    monkeypatch.setattr(runtime, "_handle_signals", lambda *_: None)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(free_domain()))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    given = {name.replace("__", "."): value for name, value in params.items()}
    capfd.readouterr()
    assert start(["--ros-args", *node_arguments(*ros_args, params=given)]) == 1
    printed = capfd.readouterr().err
    lines = [line for line in printed.splitlines() if not line.startswith("[")]  # what other nodes of this process log
    assert len(lines) == 1, printed
    return lines[0]


@contextmanager
def _default(context: Context) -> Iterator[None]:
    """Make this rclpy's default context, which a process with one node uses and several nodes must not share."""
    with patch.object(utilities, "g_default_context", context):
        yield


@contextmanager
def _stderr_in_file() -> Iterator[Path]:
    """Redirect the file descriptor, which ROS writes its log to, unless it is redirected."""
    if _LOGS and os.path.samestat(os.fstat(2), _LOGS[-1].stat()):
        yield _LOGS[-1]
        return
    before = os.dup(2)
    with tempfile.NamedTemporaryFile(prefix="hosted_node_") as output:
        os.dup2(output.fileno(), 2)
        _LOGS.append(Path(output.name))
        try:
            yield _LOGS[-1]
        finally:
            _LOGS.pop()
            os.dup2(before, 2)
            os.close(before)
            os.write(2, Path(output.name).read_bytes())  # for pytest's report of a failure
