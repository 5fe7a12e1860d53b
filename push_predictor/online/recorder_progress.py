# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What has been recorded so far: figures, the line that shows them while a recording is made, and a summary."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TextIO

import numpy as np

from push_predictor.online.news import News
from push_predictor.recordings.decoder.sources import STREAMS
from push_predictor.types import IntArray

MILLI = 1e3
NANOSECOND = 1e-9
SILENCE = 3.0  # s without a sample after which a stream is called silent
SILENT_PERIODS = 4.0  # mean periods; a stream slower than once in a second may be silent for longer
LOG_PERIOD = 5.0  # s between two lines where there is no terminal
_ERASE = "\r\x1b[K"


class Pace:
    """Number, rate and largest gap of a stream's samples. since: time (s) from which on samples are expected.

    name: slider, pusher, wrench or the covariate; source: its topic, with field or frame. largest_gap: s, between two
    consecutive stamps.
    """

    def __init__(self, since: float, name: str = "", source: str = "", topic: str = "") -> None:
        self.name, self.source, self.topic = name, source, topic
        self.samples = 0
        self.largest_gap = 0.0
        self._first = self._last = 0  # ns
        self._heard = since

    def add(self, stamp: IntArray, now: float) -> None:
        """Add samples with stamps (n,) in ns that arrived by now (s); now is of the clock of `since`."""
        if not len(stamp):
            return
        if not self.samples:
            self._first = self._last = int(stamp[0])
        gaps = np.diff(stamp, prepend=self._last) * NANOSECOND
        self.largest_gap = max(self.largest_gap, float(gaps.max()))
        self.samples += len(stamp)
        self._last, self._heard = int(stamp[-1]), now

    @property
    def rate(self) -> float:
        """Samples per second, 0 for fewer than two."""
        span = (self._last - self._first) * NANOSECOND
        return (self.samples - 1) / span if span > 0.0 else 0.0

    def silent(self, now: float) -> float:
        """For how long (s) there has been no sample; 0 while that is not unusual."""
        period = 1.0 / self.rate if self.rate else 0.0
        quiet = now - self._heard
        return quiet if quiet >= max(SILENCE, SILENT_PERIODS * period) else 0.0


@dataclass(frozen=True)
class Progress:
    """A recording at one moment.

    seconds: since its first message. windows, pushes and contact (the share of the slider's samples in which the tip
    touches it) are None without a rig. messages: by topic. problems: {what it is about: sentence}.
    """

    path: str
    seconds: float
    messages: Mapping[str, int]
    streams: tuple[Pace, ...]
    windows: int | None
    pushes: int | None
    contact: float | None
    problems: Mapping[str, str] = field(default_factory=dict)

    @property
    def started(self) -> bool:
        """Whether a message has been written, and so a bag exists."""
        return any(self.messages.values())

    def to_line(self) -> str:
        """One line: time, windows, contact, gap, what is missing (first sentences), streams."""
        parts = [f"{self.seconds:.1f} s" if self.started else "waiting for messages", *self._found()]
        parts += [text.partition(". ")[0].rstrip(".") for text in self.problems.values()]
        parts += [f"{each.name} {each.samples} ({each.rate:.3g} Hz)" for each in self.streams if each.samples]
        return ", ".join(parts)

    def to_text(self) -> str:
        """The summary of a recording that has ended, in lines."""
        if not self.started:
            return "\n".join(["No message arrived. No bag was written.", *self.problems.values()])
        lines = [
            ", ".join([f"{self.path}: {self.seconds:.1f} s, {sum(self.messages.values())} messages", *self._found()])
        ]
        for each in self.streams:
            gap = f", {each.rate:.3g} Hz, largest gap {_milliseconds(each.largest_gap)}" if each.samples else ""
            source = f" ({each.source})" if each.name in STREAMS else ""
            lines.append(f"  {each.name}{source}: {each.samples} samples{gap}")
        return "\n".join([*lines, *self.problems.values()])

    def to_json(self) -> dict[str, object]:
        """The summary for machines."""
        streams = {
            each.source: {
                "stream": each.name,
                "samples": each.samples,
                "rate": each.rate,
                "largest_gap": each.largest_gap,
            }
            for each in self.streams
        }
        return {
            "recording": self.path if self.started else None,
            "seconds": self.seconds,
            "messages": dict(self.messages),
            "streams": streams,
            "windows": self.windows,
            "pushes": self.pushes,
            "contact": self.contact,
            "problems": list(self.problems.values()),
        }

    def _found(self) -> list[str]:
        found = []
        if self.windows is not None:
            pushes = "1 push" if self.pushes == 1 else f"{self.pushes} pushes"
            found.append(f"{'1 window' if self.windows == 1 else f'{self.windows} windows'} of {pushes}")
        if self.contact is not None:
            found.append(f"contact {100.0 * self.contact:.0f} %")
        if streams := [each for each in self.streams if each.name in STREAMS and each.samples > 1]:
            worst = max(streams, key=lambda each: each.largest_gap)
            found.append(f"largest gap {_milliseconds(worst.largest_gap)} ({worst.name})")
        return found


def _milliseconds(seconds: float) -> str:
    return f"{MILLI * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


class LiveLine:
    """Shows progress, and each problem once when it has lasted for two calls.

    inform, warn: log a line. stream: a terminal gets one line that is written over.
    """

    def __init__(self, inform: Callable[[str], None], warn: Callable[[str], None], stream: TextIO = sys.stderr) -> None:
        self._inform, self._warn, self._stream = inform, warn, stream
        self._terminal = stream.isatty()
        self._news = News()
        self._logged = -LOG_PERIOD

    def show(self, progress: Progress, now: float) -> None:
        """Show the progress at a time (s); call it once a second."""
        if new := self._news.of(dict.fromkeys(progress.problems, "")):
            self.clear()
            for key in new:
                self._warn(progress.problems[key])
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
