# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The life of a node process: start, spin, signals, end. SIGINT and SIGTERM end it with status 0.

Their handlers run in the main thread, between two of its instructions. So the main thread only waits: another thread
creates the node, starts it and spins it.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import queue
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from typing import Any, NoReturn, Protocol, TypeAlias

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
from push_predictor.online.child_process import kill_children

GRACE = 0.3  # s in which a start or a callback may still end after a signal
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

    def destroy_node(self) -> None:
        """As rclpy's Node has it."""


MakeNode: TypeAlias = Callable[["Stop"], Closable]


class Stop:
    """A request to end the process, made by a signal, the node itself or one of its threads."""

    def __init__(self) -> None:
        # Not an Event: a signal handler that calls set() while its own thread is inside wait() can block for ever on
        # the lock of that Event. put() of a SimpleQueue is reentrant.
        self._requests: queue.SimpleQueue[None] = queue.SimpleQueue()
        self.error: BaseException | None = None
        self.signalled = False

    def request(self) -> None:
        """End with status 0. May be called by a signal handler."""
        self._requests.put(None)

    def signal(self) -> None:
        """The same for a signal: what takes longer than GRACE is then interrupted."""
        self.signalled = True
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


def run(
    name: str, make_node: MakeNode, args: Sequence[str] | None = None, start: Callable[[Any], None] | None = None
) -> int:
    """Create a node, start it, spin it until a signal or Stop, close it; returns the exit status.

    make_node: returns a rclpy Node that is Closable; its PushPredictorError becomes one line on stderr and status 1.
    start: called with the node before it spins; what takes longer than a tenth of a second belongs here.
    Discovery is limited to this machine unless the environment states otherwise. The node is not created without the
    security that the environment requires, for --help and --version, nor with an unknown argument (SystemExit).
    """
    _parse(name, args)
    stop = Stop()
    _handle_signals(stop)
    life = _Life(name, make_node, stop, args, start)
    life.begin()
    stop.wait()
    return life.end()


class _InterruptedError(BaseException):
    """Raised in the thread of a node: no handler of Exception catches it."""


class _Life:
    """A node, from its creation to its end, in a thread of its own."""

    def __init__(
        self,
        name: str,
        make_node: MakeNode,
        stop: Stop,
        args: Sequence[str] | None,
        start: Callable[[Any], None] | None,
    ) -> None:
        self._name, self._make_node, self._stop, self._args, self._start = name, make_node, stop, args, start
        self._node: Closable | None = None
        self._executor: Executor | None = None
        self._spinning = threading.Event()
        self._ending = False
        self._thread = threading.Thread(target=self._live, name="executor", daemon=True)

    def begin(self) -> None:
        """Create, start and spin the node."""
        self._thread.start()

    def end(self) -> int:
        """Close the node; returns the exit status."""
        self._await_start()
        try:
            self._close()
        finally:
            rclpy.try_shutdown()
        return self._status()

    def _live(self) -> None:
        try:
            self._node = _made(self._name, self._make_node, self._stop, self._args)
            if self._start is not None:
                self._start(self._node)
            assert isinstance(self._node, Node)
            self._executor = SingleThreadedExecutor()
            self._executor.add_node(self._node)
            self._spinning.set()
            self._executor.spin()
        except ExternalShutdownException:
            self._stop.request()
        except _InterruptedError:
            self._executor = None  # a node that does not spin cannot be closed
        except BaseException as error:  # the main thread waits for it and reports it
            if not self._ending:  # rclpy's executor may use what its shutdown has destroyed
                self._stop.fail(error)

    def _await_start(self) -> None:
        """Wait until the node spins or its thread has ended; after a signal not for long."""
        while self._thread.is_alive() and not self._spinning.wait(GRACE):
            if not self._stop.signalled:
                continue
            if self._node is not None:
                self._interrupt()
            elif not self._spinning.wait(GRACE) and self._node is None:
                self._exit()  # a half-created node may have threads that only it can end

    def _close(self) -> None:
        if self._node is None:
            return
        try:
            if self._executor is not None:
                self._node.close()
        except PushPredictorError as error:
            self._stop.fail(error)
        finally:
            self._end_thread()
            self._node.destroy_node()

    def _end_thread(self) -> None:
        self._ending = True
        if self._executor is not None:
            self._executor.shutdown()
        self._thread.join(GRACE if self._stop.signalled else None)
        if self._thread.is_alive():
            self._interrupt()

    def _interrupt(self) -> None:
        """End the thread while it works, such as on the table of a model; no result is lost."""
        assert self._thread.ident is not None
        number, exception = ctypes.c_ulong(self._thread.ident), ctypes.py_object(_InterruptedError)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(number, exception)
        self._thread.join(GRACE)
        if self._thread.is_alive():
            self._exit()

    def _exit(self) -> NoReturn:
        """End the process at once. The middleware's shared memory remains."""
        kill_children()
        sys.stdout.flush()
        os._exit(self._status())

    def _status(self) -> int:
        error = self._stop.error
        if error is None:
            return 0
        refused = isinstance(error, PushPredictorError)
        if not refused and not (self._executor is None and isinstance(error, _GRAPH_ERRORS)):
            raise error
        hint = "" if refused else security_hint()
        print(f"{self._name}: {one_line(error)}{hint}", file=sys.stderr)
        return 1


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


def _made(name: str, make_node: MakeNode, stop: Stop, args: Sequence[str] | None) -> Closable:
    limited = limit_discovery()
    require_security()
    # rclpy's own handlers shut the context down at once, before the last diagnostics are published.
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    if limited:
        get_logger(name).info(LIMITED)
    return make_node(stop)


def _handle_signals(stop: Stop) -> None:
    def end(number: int, frame: object) -> None:
        stop.signal()
        signal.signal(number, signal.SIG_DFL)  # a second signal ends the process at once

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
