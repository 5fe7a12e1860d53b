# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The life of a node process: start, spin, signals, end. SIGINT and SIGTERM end it with status 0."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeAlias

import rclpy
from rclpy.context import Context
from rclpy.exceptions import InvalidNamespaceException, InvalidNodeNameException
from rclpy.executors import Executor, ExternalShutdownException, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.signals import SignalHandlerOptions

from msg_adapters.predictions import refuse
from push_predictor import __version__
from push_predictor.error_codes import ErrorCode, error_code
from push_predictor.errors import PushPredictorError
from push_predictor.nodes.network_security import LIMITED, limit_discovery, require_security, security_hint
from push_predictor.online.child_process import kill_children

TURN = 0.1  # s that the executor waits: Python handles a signal when it returns
GRACE = 0.3  # s in which a start may still end after a signal
LONGEST = 3.0  # s in which a callback of an executor with one thread may: less than a launch waits for
_NAME_ERRORS = (InvalidNamespaceException, InvalidNodeNameException)
MakeNode: TypeAlias = Callable[["Stop"], Any]


class Stop:
    """A request to end the process, made by a signal, the node itself or one of its threads."""

    def __init__(self) -> None:
        self.requested = False
        self.error: BaseException | None = None

    def request(self) -> None:
        """End with status 0."""
        self.requested = True

    def fail(self, error: BaseException) -> None:
        """End with status 1 and report the error."""
        self.error = self.error or error
        self.requested = True


def run(name: str, make_node: MakeNode, args: Sequence[str] | None = None) -> int:
    """Create a node, start it, spin it until a signal or Stop, close it; returns the exit status.

    make_node: returns a rclpy Node; its PushPredictorError becomes one line on stderr and status 1. Its method close()
    is called when it no longer spins, while the graph is still available. If it has them: start() is called before it
    spins, for what takes longer than a tenth of a second; finish() before close(), in turns with the executor, until it
    returns True; `threads` is the number of threads of the executor; abandons_callbacks is whether one runs for which
    the process will not wait.
    Discovery is limited to this machine unless the environment states otherwise. The node is not created without the
    security that the environment requires, for --help and --version, nor with an unknown argument (SystemExit).
    """
    _parse(name, args)
    stop = Stop()
    life = Life(name, make_node, stop, args)
    _handle_signals(stop, life)
    life.spin()
    signal.signal(signal.SIGALRM, signal.SIG_IGN)  # the end is not interrupted
    status = life.end()
    if life.leaves_threads:
        kill_children()
        sys.stdout.flush()
        os._exit(status)
    return status


class Life:
    """A node, from its creation to its end. spinning: whether it spins; leaves_threads: that it will not wait for."""

    def __init__(
        self,
        name: str,
        make_node: MakeNode,
        stop: Stop,
        args: Sequence[str] | None,
        context: Context | None = None,
    ) -> None:
        self._name, self._make_node, self._stop, self._args = name, make_node, stop, args
        self._context = context
        self._node: Any = None
        self._executor: Executor | None = None
        self.spinning = self.leaves_threads = False

    def spin(self) -> None:
        """Create the node, start it, and spin it until the end is requested."""
        try:
            self._node = self._made()
            getattr(self._node, "start", lambda: None)()
            threads = getattr(self._node, "threads", 1)
            several = partial(MultiThreadedExecutor, threads)
            self._executor = (several if threads > 1 else SingleThreadedExecutor)(context=self._context)
            self._executor.add_node(self._node)
            self.spinning = True
            while not self._stop.requested and self._executor.context.ok():
                self._executor.spin_once(timeout_sec=TURN)
        except ExternalShutdownException:
            self._stop.request()
        except KeyboardInterrupt:
            self.leaves_threads = self._executor is None  # half made
            self._stop.request()
        except BaseException as error:
            self._stop.fail(error)

    def end(self) -> int:
        """Close the node, in the thread in which it was spun; returns the exit status."""
        try:
            if self._executor is not None:
                self._close(self._executor)
        finally:
            if self._executor is not None:
                self._executor.shutdown(timeout_sec=0.0 if self.leaves_threads else None)
            if self._node is not None:
                self._node.destroy_node()
            rclpy.try_shutdown(context=self._context)
        return self._status()

    def _close(self, executor: Executor) -> None:
        """End a node that spins. What is wrong then is the error of the node, unless it has one already."""
        try:
            finish = getattr(self._node, "finish", lambda: True)
            while self._stop.error is None and not finish():
                executor.spin_once(timeout_sec=TURN)
        except ExternalShutdownException:
            pass
        except Exception as error:
            self._stop.fail(error)
        try:
            self._node.close()
        except Exception as error:
            self._stop.fail(error)
        self.leaves_threads |= getattr(self._node, "abandons_callbacks", False)

    def _made(self) -> Any:
        limited = limit_discovery()
        require_security()
        # rclpy's own handlers shut the context down at once, before the last diagnostics are published.
        rclpy.init(args=self._args, context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        if limited:
            get_logger(self._name).info(LIMITED)
        return self._make_node(self._stop)

    def _status(self) -> int:
        error = self._stop.error
        if error is None:
            return 0
        refused = isinstance(error, PushPredictorError)
        of_the_graph = of_rcl(error) or isinstance(error, _NAME_ERRORS)
        if not refused and not (self._executor is None and of_the_graph):
            raise error
        hint = "" if refused else security_hint()
        print(f"{self._name}: {one_line(error)}{hint}", file=sys.stderr)
        return 1


def of_rcl(error: BaseException) -> bool:
    """Whether rcl or the middleware refuses something; rclpy does not export the RuntimeError for it.

    Any other RuntimeError is a bug, which needs its traceback.
    """
    return isinstance(error, RuntimeError) and type(error).__module__.partition(".")[0] == rclpy.__name__


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


def refusal(error: Exception, response: Any, log: Any) -> Any:
    """The response to a request that failed: its reason and error code. One that left its callback would end the node.

    Logs an expected failure as a warning, once a second at most, any other with its traceback.
    """
    code, reason = error_code(error), one_line(error)
    if code == ErrorCode.INTERNAL_ERROR:
        log.error("".join(traceback.format_exception(error)))
        reason = f"internal error, see the log of the node: {error!r}"
    else:
        log.warning(reason, throttle_duration_sec=1.0)
    return refuse(response, reason, code)


def _handle_signals(stop: Stop, life: Life) -> None:
    """End at SIGINT and SIGTERM; a start that takes longer than GRACE then is interrupted, a callback after LONGEST.

    Callbacks in further threads are not interrupted: finish() and close() of their node end them.
    """

    def end(number: int, frame: object) -> None:
        stop.request()
        signal.signal(number, signal.SIG_DFL)  # a second signal ends the process at once
        signal.setitimer(signal.ITIMER_REAL, LONGEST if life.spinning else GRACE)

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    signal.signal(signal.SIGALRM, interrupt)
