# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The life of a node process: start, spin, signals, end. SIGINT and SIGTERM end it with status 0."""

from __future__ import annotations

import argparse
import queue
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from typing import Protocol

import rclpy
from rclpy.exceptions import InvalidNamespaceException, InvalidNodeNameException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from push_predictor import __version__
from push_predictor.errors import PushPredictorError
from push_predictor.nodes.network_security import LIMITED, limit_discovery, require_security, security_hint

_GRAPH_ERRORS = (
    rclpy_implementation.RCLError,
    rclpy_implementation.RCLInvalidROSArgsError,
    rclpy_implementation.UnknownROSArgsError,
    InvalidNamespaceException,
    InvalidNodeNameException,
)


class Closable(Protocol):
    """A node with a method close() that runs while the graph is still available."""

    def close(self) -> None:
        """End its threads, write and publish its last results."""


class Stop:
    """A request to end the process, made by a signal, the node itself or one of its threads."""

    def __init__(self) -> None:
        # Not an Event: a signal handler that calls set() while its own thread is inside wait() can block for ever on
        # the lock of that Event. put() of a SimpleQueue is reentrant.
        self._requests: queue.SimpleQueue[None] = queue.SimpleQueue()
        self.error: BaseException | None = None

    def request(self) -> None:
        """End with status 0. May be called by a signal handler."""
        self._requests.put(None)

    def fail(self, error: BaseException) -> None:
        """End with status 1 and report the error."""
        self.error = self.error or error
        self._requests.put(None)

    def wait(self) -> None:
        """Block until the end is requested."""
        # With a timeout: Python's main thread misses a signal that the kernel delivers to another thread.
        while True:
            try:
                return self._requests.get(timeout=0.2)
            except queue.Empty:
                continue


def run(name: str, make_node: Callable[[Stop], Closable], args: Sequence[str] | None = None) -> int:
    """Create a node, spin it until a signal or Stop, close it; returns the exit status.

    make_node: returns a rclpy Node that is Closable; its PushPredictorError becomes one line on stderr and status 1.
    Discovery is limited to this machine unless the environment states otherwise. The node is not created without the
    security that the environment requires, for --help and --version, nor with an unknown argument (SystemExit).
    """
    _parse(name, args)
    stop = Stop()
    _handle_signals(stop)
    try:
        node = _made(name, make_node, stop, args)
    except (PushPredictorError, *_GRAPH_ERRORS) as error:
        hint = "" if isinstance(error, PushPredictorError) else security_hint()
        print(f"{name}: {one_line(error)}{hint}", file=sys.stderr)
        rclpy.try_shutdown()
        return 1
    try:
        return _spin(name, node, stop)
    finally:
        rclpy.try_shutdown()


def _parse(name: str, args: Sequence[str] | None) -> None:
    """Answer --help and --version, and refuse every other argument that is not one of ROS, by SystemExit."""
    parser = argparse.ArgumentParser(
        prog=name,
        description=f"The node {name}. docs/reference/{name}.md has its parameters, topics and services.",
        epilog=f"example: {name} --ros-args --params-file PARAMS.yaml -r __ns:=/cell",
        allow_abbrev=False,
    )
    parser.add_argument("--ros-args", metavar="...", help="names, remappings and parameters, as ROS 2 has them")
    parser.add_argument("--version", action="version", version=f"push_predictor {__version__}")
    parser.parse_args(_own_arguments(sys.argv[1:] if args is None else args))


def _own_arguments(words: Sequence[str]) -> list[str]:
    """The words outside --ros-args ... --."""
    own: list[str] = []
    of_ros = False
    for word in words:
        if not of_ros and word != "--ros-args":
            own.append(word)
        of_ros = word == "--ros-args" or (of_ros and word != "--")
    return own


def one_line(error: BaseException) -> str:
    """The message of an error without line breaks."""
    return " ".join(str(error).split()) or type(error).__name__


def _made(name: str, make_node: Callable[[Stop], Closable], stop: Stop, args: Sequence[str] | None) -> Closable:
    limited = limit_discovery()
    require_security()
    # rclpy's own handlers shut the context down at once, before the last diagnostics are published.
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    if limited:
        get_logger(name).info(LIMITED)
    return make_node(stop)


def _handle_signals(stop: Stop) -> None:
    def end(number: int, frame: object) -> None:
        stop.request()
        signal.signal(number, signal.SIG_DFL)  # a second signal ends the process at once

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)


def _spin(name: str, node: Closable, stop: Stop) -> int:
    # The main thread only waits: Python runs signal handlers there, and a wait in rcl would block them.
    executor = SingleThreadedExecutor()
    assert isinstance(node, Node)
    executor.add_node(node)
    spinner = threading.Thread(target=_spin_executor, args=(executor, stop), name="executor")
    spinner.start()
    stop.wait()
    try:
        node.close()
    except PushPredictorError as error:
        stop.fail(error)
    finally:
        executor.shutdown()
        spinner.join()
        node.destroy_node()
    return _status(name, stop)


def _status(name: str, stop: Stop) -> int:
    if stop.error is None:
        return 0
    if not isinstance(stop.error, PushPredictorError):
        raise stop.error
    print(f"{name}: {one_line(stop.error)}", file=sys.stderr)
    return 1


def _spin_executor(executor: Executor, stop: Stop) -> None:
    try:
        executor.spin()
    except ExternalShutdownException:
        stop.request()
    except BaseException as error:  # the main thread waits for it and reports it
        stop.fail(error)
