# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Progress of long work on stderr: a bar with percent and time left in a terminal, lines otherwise.

The bar needs the package rich. Nothing is shown of work that takes less than two seconds.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from push_predictor.watch import Watch

PATIENCE = 2.0  # s before the first message, and between lines
REDRAW = 0.2  # s between updates of the bar
FEWEST = 0.02  # fraction done from which the time left is estimated


@contextmanager
def progress(task: str) -> Iterator[Watch]:
    """Show the progress of a task while it runs; the work may call the Watch that the block receives.

    Without such a call the elapsed time is shown, with calls also percent, the estimated time left and the stage.
    """
    course, done = Course(task), threading.Event()
    reporter = threading.Thread(target=_report, args=(course, done), daemon=True)
    reporter.start()
    try:
        yield course.watch
    finally:
        done.set()
        reporter.join()


class Course:
    """How far a task is. The work writes it, the thread that reports reads it."""

    def __init__(self, task: str) -> None:
        self.task, self.begun = task, time.monotonic()
        self._reached: tuple[str, float, float] | None = None  # stage, fraction, when

    def watch(self, stage: str, fraction: float) -> None:
        """Note the stage that begins and the fraction of the work that is done; a fraction never decreases."""
        _, earlier, at = self._reached or ("", -1.0, self.begun)
        now = time.monotonic()
        self._reached = (stage, min(max(fraction, earlier), 1.0), now if fraction > earlier else at)

    @property
    def fraction(self) -> float | None:
        """The fraction that is done; None if the work does not report it."""
        return None if self._reached is None else self._reached[1]

    def text(self, now: float) -> str:
        """Elapsed time, and what is known of the rest: '12 s, 40 %, about 18 s left, dx'."""
        elapsed = now - self.begun
        if self._reached is None:
            return f"{elapsed:.0f} s"
        stage, fraction, at = self._reached
        left = time_left(fraction, at - self.begun, elapsed)
        remaining = [] if left is None else [f"about {left:.0f} s left"]
        doing = stage.removeprefix(f"{self.task}: ")
        return ", ".join([f"{elapsed:.0f} s", f"{100.0 * fraction:.0f} %", *remaining, doing])


def time_left(fraction: float, at: float, elapsed: float) -> float | None:
    """Seconds left, if the rest goes as fast as the fraction that was done `at` seconds after the start.

    None if too little is done, and if more time has passed than was estimated.
    """
    if fraction < FEWEST:
        return None
    left = at / fraction - elapsed
    return left if left > 0.0 else None


def _report(course: Course, done: threading.Event) -> None:
    if done.wait(PATIENCE):
        return
    with ExitStack() as shown:
        bar = _terminal_bar()
        if bar is None:
            _print_lines(course, done)
            return
        shown.enter_context(bar)
        _draw(bar, course, done)


def _print_lines(course: Course, done: threading.Event) -> None:
    while True:
        print(f"{course.task}: {course.text(time.monotonic())}", file=sys.stderr, flush=True)
        if done.wait(PATIENCE):
            return


def _draw(bar: Any, course: Course, done: threading.Event) -> None:
    row = bar.add_task(course.task, total=None, text="")
    while True:
        known = {} if course.fraction is None else {"total": 1.0, "completed": course.fraction}
        bar.update(row, text=course.text(time.monotonic()), **known)
        if done.wait(REDRAW):
            return


def _terminal_bar() -> Any:
    """A bar of rich; None if stderr is no terminal or rich is not installed."""
    if not sys.stderr.isatty():
        return None
    try:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn
    except ImportError:
        return None
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[text]}", markup=False))
    # stdout is for results: the bar must not redirect it.
    return Progress(*columns, console=Console(stderr=True), transient=True, redirect_stdout=False)


class JobProgress:
    """Progress of stages with batches of jobs; implements the paper's protocols Watch and Stages."""

    def __init__(self, watch: Watch) -> None:
        self._watch = watch
        self._stage, self._number, self._stages = "", 1, 1
        self._doing, self._done, self._count = "", 0, 0

    def stage(self, number: int, of: int, title: str) -> None:
        """Start a stage."""
        self._stage, self._number, self._stages = f"{number}/{of} {title}", number, of
        self._doing, self._done, self._count = "", 0, 0
        self._notify()

    def begin(self, doing: str, count: int) -> None:
        """Start a batch of jobs."""
        self._doing, self._done, self._count = doing, 0, count
        self._notify()

    def advance(self) -> None:
        """Count one finished job."""
        self._done += 1
        self._notify()

    def _notify(self) -> None:
        share = self._done / self._count if self._count else 0.0
        jobs = f": {self._doing} {self._done} of {self._count}" if self._doing else ""
        self._watch(self._stage + jobs, (self._number - 1 + share) / self._stages)
