# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Processes that a node starts for long work. multiprocessing is imported when the first one starts: it takes time."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from push_predictor.error_codes import ErrorCode, error_code
from push_predictor.errors import PushPredictorError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess

NICENESS = 5  # samples and predictions come first; on a busy machine a lower priority would never be served


@dataclass(frozen=True)
class Failure:
    """The reason why a process has no result, on one line, and its error code."""

    reason: str
    code: ErrorCode


class Child:
    """A process that ends with this one and that no SIGINT reaches: the node ends it. It can be started again.

    work: called there with its end of a pipe and the arguments. Ctrl-C reaches the whole process group; a child that is
    still importing would print a traceback. process: the present one or the last, None before the first.
    """

    def __init__(self, name: str, work: Callable[..., None]) -> None:
        self._name, self._work = name, work
        self._pipe: Connection | None = None
        self.process: BaseProcess | None = None

    @property
    def started(self) -> bool:
        """Whether it was started, and not stopped since."""
        return self._pipe is not None

    @property
    def alive(self) -> bool:
        """Whether it works."""
        return self.process is not None and self.process.is_alive()

    def status(self, patience: float = 0.0) -> int:
        """That of the last process, negative for a signal that ended it; 0 if it does not end within so many s."""
        if self.process is None:
            return 0
        self.process.join(patience)
        return self.process.exitcode or 0

    def start(self, *arguments: Any) -> None:
        """Start a process, after the end of the present one."""
        import multiprocessing
        from multiprocessing import resource_tracker

        self.stop()
        ours, theirs = multiprocessing.Pipe()
        context = multiprocessing.get_context("spawn")  # a fork would inherit the locks of the middleware's threads
        work = (self._work, theirs, *arguments)
        process = context.Process(target=_begin, args=work, daemon=True, name=self._name)
        resource_tracker.ensure_running()  # the start of its process would unblock the signal
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # a child inherits it
        try:
            with _not_interrupted():
                process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        theirs.close()
        self.process, self._pipe = process, ours

    def send(self, message: Any) -> None:
        """Send a message to the started process; it is lost if that has ended."""
        assert self._pipe is not None
        with suppress(OSError):
            self._pipe.send(message)

    def received(self, patience: float = 0.0) -> Any:
        """The next message, None if none comes within so many s, and without a process.

        A Failure if the work raised PushPredictorError or OSError, or the process has ended.
        """
        try:
            return self._pipe.recv() if self._pipe is not None and self._pipe.poll(patience) else None
        except (EOFError, OSError):
            status = self.status(5.0)
            how = f"signal {-status}" if status < 0 else f"status {status}"
            reason = f"the process of the {self._name} ended with {how} and no result, see the log of the node"
            return Failure(reason, ErrorCode.INTERNAL_ERROR)

    def stop(self, at_once: bool = False) -> None:
        """End the process, if there is one; at_once: by SIGKILL."""
        if self._pipe is None or self.process is None:
            return
        (self.process.kill if at_once else self.process.terminate)()
        self.process.join()
        self._pipe.close()
        self._pipe = None


@contextmanager
def _not_interrupted() -> Iterator[None]:
    """Hold back the alarm that ends a slow start of the node: cut off from its data, a new process prints a traceback.

    Masking it would not do: another thread of the node would take it.
    """
    if threading.current_thread() is not threading.main_thread():  # the others see no signals
        yield
        return
    late: list[int] = []
    handler = signal.signal(signal.SIGALRM, lambda number, frame: late.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGALRM, handler)
        if late:
            signal.raise_signal(signal.SIGALRM)


def _begin(work: Callable[..., None], pipe: Connection, *arguments: Any) -> None:
    os.nice(NICENESS)
    with suppress(EOFError, OSError):  # the node has ended
        attempt(work, pipe, *arguments)


def attempt(work: Callable[..., None], pipe: Connection, *arguments: Any) -> None:
    """Do the work of a child; an expected error becomes a message."""
    try:
        work(pipe, *arguments)
    except (PushPredictorError, OSError, EOFError) as error:
        pipe.send(Failure(" ".join(str(error).split()), error_code(error)))


def kill_children() -> None:
    """End all processes that this one has started with multiprocessing, at once."""
    if "multiprocessing" in sys.modules:
        for child in sys.modules["multiprocessing"].active_children():
            child.kill()
