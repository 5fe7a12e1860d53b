"""Progress of long computations: a bar in a terminal, a line every few seconds elsewhere."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Any

from push_predictor.commands.output import PATIENCE


class ProgressBar:
    """Shows stages and batches of jobs on stderr; implements the paper's protocols Watch and Stages."""

    def __init__(self) -> None:
        self._stage, self._doing, self._done, self._count = "", "", 0, 0
        self._begun, self._reported = time.monotonic(), time.monotonic()
        self._bar = _terminal_bar()
        self._task: int | None = None

    def __enter__(self) -> ProgressBar:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def stage(self, number: int, of: int, title: str) -> None:
        """Start a stage."""
        self._stage = f"{number}/{of} {title}"

    def begin(self, doing: str, count: int) -> None:
        """Start a batch of jobs."""
        self._doing, self._done, self._count = doing, 0, count
        if self._bar is not None:
            if self._task is not None:
                self._bar.remove_task(self._task)
            self._task = self._bar.add_task(f"{self._stage}: {doing}", total=count)
        self._report(finished=False)

    def advance(self) -> None:
        """Count one finished job."""
        self._done += 1
        if self._bar is not None:
            self._bar.advance(self._task)
        self._report(finished=self._done == self._count)

    def _report(self, finished: bool) -> None:
        """Print a line at the end of a batch and every few seconds, if there is no bar."""
        now = time.monotonic()
        if self._bar is None and (
            now - self._reported > 5 * PATIENCE or (finished and now - self._reported > PATIENCE)
        ):
            self._reported = now
            line = f"{self._stage}: {self._doing} {self._done} of {self._count}, {now - self._begun:.0f} s"
            print(line, file=sys.stderr, flush=True)


def _terminal_bar() -> Any:
    """A bar of rich; None if stderr is no terminal or rich is not installed."""
    if not sys.stderr.isatty():
        return None
    try:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
        from rich.progress import TimeRemainingColumn as Remaining
    except ImportError:
        return None
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), Remaining())
    return Progress(*columns, console=Console(stderr=True), transient=True)
