# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Processes that a node starts for long work. multiprocessing is imported when the first one starts: it takes time."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from multiprocessing.process import BaseProcess


def start_child(target: Callable[..., None], arguments: Sequence[Any], name: str) -> BaseProcess:
    """Start a process that ends with this one and that no SIGINT reaches: the node ends it.

    Ctrl-C reaches the whole process group. A child that is still importing would print a traceback.
    """
    import multiprocessing
    from multiprocessing import resource_tracker

    context = multiprocessing.get_context("spawn")  # a fork would inherit the locks of the middleware's threads
    process = context.Process(target=target, args=tuple(arguments), daemon=True, name=name)
    resource_tracker.ensure_running()  # the start of its process would unblock the signal
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # a child inherits it
    try:
        process.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    return process


def kill_children() -> None:
    """End all processes that this one has started with multiprocessing, at once."""
    if "multiprocessing" in sys.modules:
        for child in sys.modules["multiprocessing"].active_children():
            child.kill()
