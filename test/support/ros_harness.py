# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Start nodes as processes and communicate with them over DDS."""

from __future__ import annotations

import fcntl
import itertools
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty, Queue
from typing import IO, Any

from rcl_interfaces.srv import GetParameters
from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from repository import REPOSITORY

from push_predictor.models.store.model_registry import ModelRegistry

START_TIMEOUT = 60.0
COARSE_NODE = REPOSITORY / "test" / "support" / "coarse_node.py"
PATIENCE = 10.0  # s after which a call is repeated; ~/finish answers within 5 s
_HELD: deque[tuple[int, IO[str]]] = deque()
_RESERVED: set[int] = set()
_NAMES = itertools.count()


def free_domain() -> int:
    """A ROS domain (1..101) that no other test, worker or test run of this machine uses.

    A lock file is held for each of the last 12 domains of this process. `reserved_domain` is for longer use.
    The environment variable PUSH_PREDICTOR_TEST_DOMAINS, such as "41-45", narrows the range.
    """
    low, high = _domain_range()
    if _HELD and len(_HELD) >= min(12, high - low + 1 - len(_RESERVED)):
        _HELD.popleft()[1].close()
    for offset in range(high - low + 1):
        domain = low + (os.getpid() * 7 + next(_NAMES) + offset) % (high - low + 1)
        if (lock := _lock(domain)) is not None:
            _HELD.append((domain, lock))
            return domain
    raise RuntimeError(f"every ROS domain from {low} to {high} is held by another test run")


@contextmanager
def reserved_domain() -> Iterator[int]:
    """A free domain that is locked until the end of the block: for nodes that several tests share."""
    free_domain()
    domain, lock = _HELD.pop()
    _RESERVED.add(domain)
    try:
        yield domain
    finally:
        _RESERVED.remove(domain)
        lock.close()


class NodeProcess(subprocess.Popen[bytes]):
    """A node; stdout and stderr go to one file, so that a full pipe never stops it."""

    log: Path

    def text(self) -> str:
        """Everything it has printed so far."""
        return self.log.read_text(errors="replace")

    def wait_for_text(self, text: str, timeout: float = START_TIMEOUT) -> str:
        """Wait until it has printed `text`; returns everything printed. Raises AssertionError otherwise."""
        wait_until(lambda: text in self.text() or self.poll() is not None, timeout)
        assert text in self.text(), f"{text!r} was not printed (exit status {self.poll()}):\n{self.text()}"
        return self.text()

    def stop(self, number: int = signal.SIGINT, timeout: float = 30.0) -> int:
        """Send a signal and return the exit status; kill and fail if it does not end."""
        if self.poll() is None:
            self.send_signal(number)
        try:
            return self.wait(timeout)
        except subprocess.TimeoutExpired:
            self.send_signal(signal.SIGABRT)  # PYTHONFAULTHANDLER prints where every thread is
            self.wait()
            raise AssertionError(f"signal {number} did not end the node:\n{self.text()}") from None


@contextmanager
def node_process(
    executable: str,
    *ros_args: str,
    domain: int,
    namespace: str | None = None,
    params: Mapping[str, Any] | None = None,
    coarse: bool = False,
    folder: Path = REPOSITORY,
) -> Iterator[NodeProcess]:
    """Run `python -m push_predictor.nodes.EXECUTABLE --ros-args ...`; leaving stops it (SIGINT, then kill).

    ros_args follow --ros-args as they are, such as "-r", "slider/pose:=/vicon/pose". params: name to value.
    coarse: with pictures that take a quarter of the time (coarse_node.py). folder: where it runs.
    """
    arguments = node_arguments(*ros_args, namespace=namespace, params=params)
    started = [str(COARSE_NODE), executable] if coarse else ["-m", f"push_predictor.nodes.{executable}"]
    command = [sys.executable, *started, "--ros-args", *arguments]
    if executable == "predict_server":
        keep_tables(params)
    with tempfile.TemporaryDirectory(prefix="push_node_") as logs:
        log = Path(logs) / "output.txt"
        with log.open("wb") as output:
            process = NodeProcess(
                command, cwd=folder, env=node_environment(domain), stdout=output, stderr=subprocess.STDOUT
            )
        process.log = log
        try:
            yield process
        finally:
            _end(process)


def keep_tables(params: Mapping[str, Any] | None) -> None:
    """Compute and keep the tables of the models of a server, as `train` does."""
    ModelRegistry().load_all(map(str, (params or {}).get("models", ())))


def node_arguments(*ros_args: str, namespace: str | None = None, params: Mapping[str, Any] | None = None) -> list[str]:
    """The words after --ros-args: ros_args as they are, then namespace and parameters."""
    words = [*ros_args, *(["-r", f"__ns:={namespace}"] if namespace else [])]
    for name, value in (params or {}).items():
        words += ["-p", f"{name}:={json.dumps(str(value) if isinstance(value, Path) else value)}"]
    return words


def node_environment(domain: int) -> dict[str, str]:
    """The environment of a node under test: its domain, this machine only, this repository's packages."""
    environment = dict(os.environ)
    # A Python with its library path starts once; without it, ROS makes it start again, unless this variable is set.
    if str(Path(sys.prefix, "lib")) not in environment.get("LD_LIBRARY_PATH", "").split(os.pathsep):
        environment.pop("_ROS_WHEELS_BOOTSTRAP_COMPLETE", None)
    environment.update(
        ROS_DOMAIN_ID=str(domain),
        ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
        PYTHONUNBUFFERED="1",
        PYTHONFAULTHANDLER="1",
        OPENBLAS_NUM_THREADS="1",
        PYTHONPATH=os.pathsep.join(filter(None, [str(REPOSITORY), environment.get("PYTHONPATH")])),
    )
    return environment


@contextmanager
def ros_context(domain: int, namespace: str | None = None) -> Iterator[Node]:
    """The test's own node in `domain`, spun by a background thread: callbacks and `client.call` just work."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    context = Context()
    context.init(args=[], domain_id=domain)
    node = Node(f"test_{os.getpid()}_{next(_NAMES)}", context=context, namespace=namespace or "")
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    thread = threading.Thread(target=_spin, args=(executor,), daemon=True)
    thread.start()
    try:
        yield node
    finally:
        executor.shutdown()
        thread.join(5.0)
        node.destroy_node()
        context.try_shutdown()


def wait_until(condition: Callable[[], bool], timeout: float = START_TIMEOUT) -> bool:
    """Poll until `condition` holds; False after `timeout` seconds."""
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


def in_spin(node: Node, function: Callable[[], Any]) -> Any:
    """`function()` in the thread that spins `node`.

    rclpy's action client notes a request after it has sent it: from another thread an early answer is lost.
    """
    assert node.executor
    task = node.executor.create_task(function)
    assert wait_until(task.done)
    return task.result()


def acquaint(node: Node, server: str, timeout: float = START_TIMEOUT) -> None:
    """Wait until the node named `server` knows every subscription and client that `node` has made so far.

    It discovers them in the order of their creation and answers the last one, which may safely be called twice.
    """
    client = node.create_client(GetParameters, f"{server}/get_parameters")
    try:
        call(client, GetParameters.Request(), timeout, patience=1.0)
    finally:
        node.destroy_client(client)


def call(client: Client, request: Any, timeout: float = START_TIMEOUT, patience: float = PATIENCE) -> Any:
    """Wait for the service, call it and return the response.

    Repeats the request every `patience` seconds: the middleware drops the answer to a client that it has not matched
    within 0.1 s, as happens to a new client on a busy machine. For a service that must not be called twice, `acquaint`
    first.
    Raises AssertionError if either takes longer than `timeout` (s). Another thread must spin the node.
    """
    assert client.wait_for_service(timeout), f"no service {client.srv_name} after {timeout} s"
    deadline, answers, asked = time.monotonic() + timeout, Queue[Future](), list[Future]()
    try:
        while (left := deadline - time.monotonic()) > 0.0:
            asked.append(client.call_async(request))
            asked[-1].add_done_callback(answers.put)
            with suppress(Empty):
                return answers.get(timeout=min(left, patience)).result()
    finally:
        for future in asked:
            client.remove_pending_request(future)
    raise AssertionError(f"{client.srv_name} did not answer within {timeout} s")


def wait_for_publisher(node: Node, topic: str, timeout: float = START_TIMEOUT) -> None:
    """Wait until somebody publishes `topic`; AssertionError otherwise."""
    assert wait_until(lambda: node.count_publishers(topic) > 0, timeout), f"nobody publishes {topic}"


def _domain_range() -> tuple[int, int]:
    low, _, high = os.environ.get("PUSH_PREDICTOR_TEST_DOMAINS", "1-101").partition("-")
    return int(low), int(high or low)


def _lock(domain: int) -> IO[str] | None:
    handle = (Path(tempfile.gettempdir()) / f"push_predictor_domain_{domain}.lock").open("a")
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        handle.close()
        return None
    return handle


def _spin(executor: SingleThreadedExecutor) -> None:
    try:
        executor.spin()
    except ExternalShutdownException:
        return


def _end(process: NodeProcess) -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        process.wait(30.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
