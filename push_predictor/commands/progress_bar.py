"""Where a long piece of work is: a bar in a terminal, a line now and then anywhere else."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Any

from push_predictor.commands.output import PATIENCE


class ProgressBar:
    """Told of stages and of pieces of work (paper.work.Watch, paper.report.Stages); shows them on stderr."""

    def __init__(self) -> None:
        self._stage, self._doing, self._done, self._count = "", "", 0, 0
        self._begun, self._said = time.monotonic(), time.monotonic()
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
        """A part of the whole begins."""
        self._stage = f"{number}/{of} {title}"

    def begin(self, doing: str, count: int) -> None:
        """A batch of pieces of work begins."""
        self._doing, self._done, self._count = doing, 0, count
        if self._bar is not None:
            if self._task is not None:
                self._bar.remove_task(self._task)
            self._task = self._bar.add_task(f"{self._stage}: {doing}", total=count)
        self._speak(finished=False)

    def advance(self) -> None:
        """One piece is done."""
        self._done += 1
        if self._bar is not None:
            self._bar.advance(self._task)
        self._speak(finished=self._done == self._count)

    def _speak(self, finished: bool) -> None:
        """A line at the end of a batch and every few seconds, where there is no terminal to draw on."""
        now = time.monotonic()
        if self._bar is None and (now - self._said > 5 * PATIENCE or (finished and now - self._said > PATIENCE)):
            self._said = now
            told = f"{self._stage}: {self._doing} {self._done} of {self._count}, {now - self._begun:.0f} s"
            print(told, file=sys.stderr, flush=True)


def _terminal_bar() -> Any:
    """A bar of rich, None where stderr is no terminal or rich is not installed."""
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
