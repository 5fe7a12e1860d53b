# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Progress of long work on stderr: elapsed time, percent, time left and stage; one line that changes in a terminal.

Nothing is shown of work that takes less than two seconds.
"""

from __future__ import annotations

import shutil
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from push_predictor.watch import Watch

PATIENCE = 2.0  # s before the first message, and between messages
FEWEST = 0.02  # fraction done from which the time left is estimated
CLEAR = "\r\x1b[K"  # the line of a terminal


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

    def text(self, now: float) -> str:
        """Elapsed time, and what is known of the rest: '12 s, 40 %, about 18 s left, dx'."""
        elapsed = now - self.begun
        if self._reached is None:
            return f"{elapsed:.0f} s"
        stage, fraction, at = self._reached
        left = (at - self.begun) / fraction - elapsed if fraction >= FEWEST else 0.0  # if the rest goes as fast
        remaining = [f"about {left:.0f} s left"] if left > 0.0 else []
        doing = stage.removeprefix(f"{self.task}: ")
        return ", ".join([f"{elapsed:.0f} s", f"{100.0 * fraction:.0f} %", *remaining, doing])


def _report(course: Course, done: threading.Event) -> None:
    terminal, shown = sys.stderr.isatty(), False
    while not done.wait(PATIENCE):
        line, shown = f"{course.task}: {course.text(time.monotonic())}", True
        if terminal:
            line = CLEAR + line[: shutil.get_terminal_size().columns - 1]
        print(line, end="" if terminal else "\n", file=sys.stderr, flush=True)
    if terminal and shown:
        print(CLEAR, end="", file=sys.stderr, flush=True)
