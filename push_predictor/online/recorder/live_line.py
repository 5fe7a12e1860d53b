# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The line that shows a recording in progress: rewritten on a terminal, else logged every few seconds."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from typing import TextIO

from push_predictor.online.recorder.progress import Progress

LOG_PERIOD = 5.0  # s between two lines where there is no terminal
_ERASE = "\r\x1b[K"


class LiveLine:
    """Shows progress, and each problem once when it has lasted for two calls.

    inform, warn: log a line. stream: a terminal gets one line that is written over.
    """

    def __init__(self, inform: Callable[[str], None], warn: Callable[[str], None], stream: TextIO = sys.stderr) -> None:
        self._inform, self._warn, self._stream = inform, warn, stream
        self._terminal = stream.isatty()
        self._before: set[str] = set()
        self._warned: set[str] = set()
        self._logged = -LOG_PERIOD

    def show(self, progress: Progress, now: float) -> None:
        """Show the progress at a time (s); call it once a second."""
        present = progress.problems
        if new := [key for key in present if key in self._before - self._warned]:
            self.clear()
            for key in new:
                self._warn(present[key])
        self._warned = (self._warned | {*new}) & present.keys()
        self._before = {*present}
        if self._terminal:
            width = shutil.get_terminal_size().columns - 1
            self._write(_ERASE + _cut(progress.to_line(), width))
        elif now - self._logged >= LOG_PERIOD:
            self._logged = now
            self._inform(progress.to_line())

    def clear(self) -> None:
        """Remove the line from the terminal, so that another can be printed."""
        if self._terminal:
            self._write(_ERASE)

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()


def _cut(line: str, width: int) -> str:
    return line if len(line) <= width else f"{line[: width - 1]}…"
