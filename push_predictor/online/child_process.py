# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Processes that a node starts for long work. multiprocessing is imported when the first one starts: it takes time."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

NICENESS = 5  # samples and predictions come first; on a busy machine a lower priority would never be served


class Child:
    """A process that ends with this one and that no SIGINT reaches: the node ends it.

    work: called there with its end of a pipe and the arguments. Ctrl-C reaches the whole process group; a child that is
    still importing would print a traceback.
    """

    def __init__(self, name: str, work: Callable[..., None], *arguments: Any) -> None:
        import multiprocessing
        from multiprocessing import resource_tracker

        self._pipe, theirs = multiprocessing.Pipe()
        context = multiprocessing.get_context("spawn")  # a fork would inherit the locks of the middleware's threads
        self.process = context.Process(target=_begin, args=(work, theirs, *arguments), daemon=True, name=name)
        resource_tracker.ensure_running()  # the start of its process would unblock the signal
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # a child inherits it
        try:
            with _not_interrupted():
                self.process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        theirs.close()

    def send(self, message: Any) -> None:
        """Send a message. Raises OSError if the process has ended."""
        self._pipe.send(message)

    def received(self, patience: float = 0.0) -> Any:
        """The next message, None if none comes within so many s. Raises EOFError or OSError if the process ended."""
        return self._pipe.recv() if self._pipe.poll(patience) else None

    def stop(self, at_once: bool = False) -> None:
        """End the process; at_once: by SIGKILL."""
        (self.process.kill if at_once else self.process.terminate)()
        self.process.join()
        self._pipe.close()


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
    work(pipe, *arguments)


def kill_children() -> None:
    """End all processes that this one has started with multiprocessing, at once."""
    if "multiprocessing" in sys.modules:
        for child in sys.modules["multiprocessing"].active_children():
            child.kill()
