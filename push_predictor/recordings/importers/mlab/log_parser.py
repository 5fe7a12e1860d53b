# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Parser of the push logs of MLab_EXP (Zhou, Paolini, Bagnell, Mason, ICRA 2016), lengths in mm.

A log is the number of pushes, then for each push: object pose before, object pose after (x y z qw qx qy qz), the
number of forces, that many lines `t fx fy`, the number of robot poses, that many lines `t x y z qw qx qy qz`.
"""

from __future__ import annotations

import gzip
import zlib
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite
from pathlib import Path

import numpy as np

from push_predictor.errors import ImportSourceError
from push_predictor.recordings.importers.report import Notes
from push_predictor.types import Array

MOVED_BY_HAND = 1.0  # mm between two pushes
POSE_WIDTH, FORCE_WIDTH, ROBOT_WIDTH = 7, 3, 8


@dataclass(frozen=True, eq=False)
class LogPush:
    """One push: number in the log, from 0; line; before, after (7,); force (n, 3); robot (m, 8)."""

    number: int
    line: int
    before: Array
    after: Array
    force: Array
    robot: Array

    @property
    def time(self) -> float:
        """Start of the push: Unix seconds of the first force, else of the first robot pose."""
        return float((self.force if len(self.force) else self.robot)[0, 0])


class _EndedError(Exception):
    """The file ends within a push."""


class _Lines:
    """The lines of a log as numbers, with their line numbers."""

    def __init__(self, path: Path) -> None:
        self.path = path
        lines = enumerate(_text(path).splitlines(), start=1)
        self.lines = [(number, line.split()) for number, line in lines if line.strip()]
        self.next = 0

    def __bool__(self) -> bool:
        return self.next < len(self.lines)

    def line(self) -> int:
        return self.lines[min(self.next, len(self.lines) - 1)][0]

    def width(self) -> int:
        return len(self.lines[self.next][1]) if self else 0

    def row(self, width: int, what: str) -> list[float]:
        if not self:
            raise _EndedError
        number, words = self.lines[self.next]
        self.next += 1
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if len(values) != width or not all(map(isfinite, values)):  # NumPy would take most of the time
            wanted = f"{what}: {width} finite number{'s' if width > 1 else ''}"
            raise ImportSourceError(f"{self.path}:{number}: {' '.join(words)[:60]!r}, expected {wanted}")
        return values

    def count(self, what: str) -> int:
        number = self.line()
        (value,) = self.row(1, what)
        if value < 0 or value != int(value):
            raise ImportSourceError(f"{self.path}:{number}: {value!r}, expected {what}: a whole number, 0 or above")
        return int(value)

    def table(self, width: int, what: str) -> Array:
        count = self.count(f"the number of {what}s")
        if len(self.lines) - self.next < count:
            raise _EndedError
        values = _numbers([words for _, words in self.lines[self.next : self.next + count]], width)
        if values is None:  # line by line, which names the wrong one
            return np.array([self.row(width, what) for _ in range(count)]).reshape(-1, width)
        self.next += count
        return values


def _numbers(rows: list[list[str]], width: int) -> Array | None:
    """The rows (n, width) as numbers, None unless all are finite."""
    try:
        values = np.array(rows, dtype=np.float64).reshape(len(rows), width)
    except ValueError:
        return None
    return values if np.all(np.isfinite(values)) else None


def read_log(path: Path, notes: Notes) -> list[LogPush]:
    """The complete pushes of a log. Raises ImportSourceError with file and line."""
    lines = _Lines(path)
    if not lines:
        raise ImportSourceError(f"{path}: is empty, expected a push log")
    stated = None
    if lines.width() == POSE_WIDTH:
        notes.repaired.append(f"{path}:{lines.line()}: the number of pushes is missing; read to the end of the file")
    else:
        stated = lines.count("the number of pushes")
    pushes = _pushes(lines, notes)
    if stated is not None and stated != len(pushes):
        notes.repaired.append(f"{path}:1: states {stated} pushes, contains {len(pushes)}")
    return pushes


def report_irregularities(path: Path, pushes: list[LogPush], notes: Notes) -> None:
    """Note missing forces, repeated poses, a clock set back and objects moved by hand in a log."""
    if bare := [push.number for push in pushes if not len(push.force)]:
        notes.dropped.append(f"{path}: {len(bare)} pushes without forces; normal_force and tangential_force are empty")
    repeats = sum(int(np.sum(np.all(np.diff(push.robot[:, 1:], axis=0) == 0.0, axis=1))) for push in pushes)
    if repeats:
        notes.repaired.append(f"{path}: {repeats} robot poses repeat the one before, ignored in the contact time")
    timed = [push for push in pushes if len(push.force) or len(push.robot)]
    for one, two in pairwise(timed):
        if (back := one.time - two.time) > 0.0:
            notes.repaired.append(
                f"{path}:{two.line}: after push {one.number} the clock goes back by {back:.0f} s, so the log "
                "joins two sessions; elapsed_time counts from the earliest stamp"
            )
            continue
        moved = float(np.hypot(*(two.before - one.after)[:2]))
        if moved > MOVED_BY_HAND:
            notes.assume(f"{path}:{two.line}: the object was moved by hand {moved:.1f} mm before push {two.number}")


def _pushes(lines: _Lines, notes: Notes) -> list[LogPush]:
    pushes: list[LogPush] = []
    while lines:
        first = lines.line()
        try:
            pushes.append(_push(lines, len(pushes), first))
        except _EndedError:
            notes.dropped.append(f"{lines.path}:{first}: push {len(pushes)} is cut off by the end of the file")
            break
    return pushes


def _push(lines: _Lines, number: int, first: int) -> LogPush:
    before = np.array(lines.row(POSE_WIDTH, "the object's pose before the push"))
    after = np.array(lines.row(POSE_WIDTH, "the object's pose after the push"))
    force = lines.table(FORCE_WIDTH, "force")
    return LogPush(number, first, before, after, force, lines.table(ROBOT_WIDTH, "robot pose"))


def _text(path: Path) -> str:
    try:
        data = path.read_bytes()
        return (gzip.decompress(data) if path.suffix == ".gz" else data).decode("ascii")
    except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
        raise ImportSourceError(f"{path}: cannot be read ({error})") from None
