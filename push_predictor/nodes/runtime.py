"""What surrounds every node: start, spin, signals, end. SIGINT and SIGTERM both end a node with status 0."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Sequence
from typing import Protocol

import rclpy
from rclpy.exceptions import InvalidNamespaceException, InvalidNodeNameException
from rclpy.executors import Executor, ExternalShutdownException, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

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
    """A node: close() writes and publishes what is left, while the graph is still there."""

    def close(self) -> None:
        """End its threads, publish its last words."""


class Stop:
    """Asks the process to end; set by a signal, by the node itself, or by a thread of it that failed."""

    def __init__(self) -> None:
        self._event = threading.Event()
        self.error: BaseException | None = None

    def request(self) -> None:
        """End with status 0."""
        self._event.set()

    def fail(self, error: BaseException) -> None:
        """End with status 1 and report the error."""
        self.error = self.error or error
        self._event.set()

    def wait(self) -> None:
        """Block until somebody asks."""
        # In turns: Python's main thread sleeps through a signal that the kernel hands to another thread.
        while not self._event.wait(0.2):
            pass


def run(name: str, make_node: Callable[[Stop], Closable], args: Sequence[str] | None = None, threads: int = 1) -> int:
    """Make a node, spin it until a signal or Stop, close it; answers the exit status.

    A PushPredictorError while the node is made becomes one line on stderr and status 1. threads above 1 takes a
    MultiThreadedExecutor. make_node must answer a rclpy Node that is Closable. Other machines do not find the node
    unless the environment asks for that; it is not made without the security that the environment asks for.
    """
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
        return _spin(name, node, stop, threads)
    finally:
        rclpy.try_shutdown()


def one_line(error: BaseException) -> str:
    """The message of an error without line breaks."""
    return " ".join(str(error).split()) or type(error).__name__


def _made(name: str, make_node: Callable[[Stop], Closable], stop: Stop, args: Sequence[str] | None) -> Closable:
    limited = limit_discovery()
    require_security()
    # rclpy's own handlers end the context at once: the last diagnostics could not be published any more.
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    if limited:
        get_logger(name).info(LIMITED)
    return make_node(stop)


def _handle_signals(stop: Stop) -> None:
    def end(number: int, frame: object) -> None:
        stop.request()
        signal.signal(number, signal.SIG_DFL)  # a second one ends the process at once

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)


def _spin(name: str, node: Closable, stop: Stop, threads: int) -> int:
    # The main thread only waits: Python runs signal handlers there, and a wait in rcl would keep it from doing so.
    executor = MultiThreadedExecutor(threads) if threads > 1 else SingleThreadedExecutor()
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
    except BaseException as error:  # reported by the main thread, which waits for it
        stop.fail(error)
