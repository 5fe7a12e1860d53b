# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Poses that were not measured: repeated with new stamps, or continued on a line, while the body moves on.

A tracker that lost the body, or a slower source, repeats the last pose. A repeat is stale if the next change exceeds
what a body at the speed seen around it moves in one interval. Stale poses of a slow source are replaced by those on the
line to its next pose, as between any two samples. Where the source is silent for longer than usual they are discarded,
which makes a dropout. A body at rest repeats its pose, too: nothing is changed there.

A tracker may also continue with the last velocity. Such poses lie exactly on a line, which the next measured pose
leaves; poses measured with noise never do. A stream without noise, as of a simulation, is left as it is: a body may
move on a line. So are poses between two measured ones.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.recordings.dropouts import NANOSECOND, longest_interval, usual_interval
from push_predictor.recordings.streams import taken
from push_predictor.recordings.windows.resolution import changes, lengths
from push_predictor.recordings.windows.stamp_order import OrderedSamples, Portions
from push_predictor.types import Array, BoolArray, IntArray

HARMLESS = 1e-4  # m: so small a change makes no outcome wrong
CONTINUES = 5.0  # times the way at the speed after it; a body that was placed elsewhere moves farther
MARGIN = 1.5  # times the way in one interval: after one missing sample it is 2
LONGEST_HOLD = 1_000_000_000  # ns: a body that repeats its pose for longer is at rest
USUAL = 9  # changes whose median interval is the usual one
EXACT = 1e-8  # m off the line of the two poses before: rounding of a continued pose
NOISE = 1e-5  # m off it, as the median of the BEFORE poses before a run: less may be a motion without noise
BEFORE = 20
SHORTEST = 4  # poses in a run: a coincidence of so many does not happen
LONGEST = 2_000_000_000  # ns: a tracker gives a body up before
CORRECTED = 3.0  # times this noise, of the next measured pose off the line: else the body is where the line leads
LEAST = 1e-5  # m in an interval: a body at rest repeats its pose
JUDGING = BEFORE + 2  # poses before a run, of which the last BEFORE have two before them


class HeldPoses(Portions):
    """Takes the samples of one stream in order and returns them without stale ones.

    A repeat waits until the body has changed its pose twice, or for LONGEST_HOLD. The result does not depend on the
    portions. stale: number of stale samples; dropouts: intervals (s) of a source that was silent for longer than usual.
    """

    def __init__(self, angle: int | None = None) -> None:
        """Of a stream with columns as Track passes them on; angle: index of one with a heading (rad)."""
        super().__init__()  # keeps the first and the last sample of the poses before the one that waits
        self.stale = 0
        self.dropouts: list[float] = []
        self._angle = angle

    def take(self, new: OrderedSamples, final: bool = False) -> OrderedSamples:
        """Add samples and return those that are decided; with `final` all are."""
        if not len(samples := self._with(new)):
            return samples
        pose = lengths(samples.values, self._angle)
        begins = changes(pose)
        ends = np.append(begins[1:], len(pose))
        keep, values, decided = self._judge(samples, pose, begins, ends, final)
        rows = np.arange(self._returned, decided)
        found = taken(replace(samples, values=values), rows[keep[rows]])
        last = int(np.searchsorted(begins, decided - 1, side="right")) - 1  # the pose that waits
        before = slice(max(last - USUAL, 0), last)
        known = [*begins[before], *(ends[before] - 1), begins[last], decided - 1]
        rows = np.unique([*known, *range(decided, len(pose))])
        self._keep(samples, rows, int(np.sum(rows < decided)))
        return found

    def _judge(
        self, samples: OrderedSamples, pose: Array, begins: IntArray, ends: IntArray, final: bool
    ) -> tuple[BoolArray, Array, int]:
        """Which samples (n,) are kept, their values, and how many are decided; begins, ends: of the runs of a pose."""
        stamp = samples.stamp
        keep, values = np.ones(len(pose), dtype=np.bool_), samples.values.copy()
        for run in np.flatnonzero((ends - begins > 1) & (ends > self._returned)).tolist():
            begin, end = int(begins[run]), int(ends[run])
            if stamp[end - 1] - stamp[begin] > LONGEST_HOLD:
                continue
            if not final and not self._decidable(stamp, begins, run):
                return keep, values, max(begin + 1, self._returned)
            if not self._is_stale(stamp, pose, begins, run, samples.values):
                continue
            rows = np.arange(max(begin + 1, self._returned), end)
            interval = float(stamp[end] - stamp[begin]) * NANOSECOND
            self.stale += len(rows)
            if interval <= longest_interval(usual_interval(stamp[begins[: run + 2][-USUAL - 1 :]])):
                share = (stamp[rows] - stamp[begin]) / (stamp[end] - stamp[begin])
                values[rows] = values[begin] + share[:, None] * (values[end] - values[begin])
            else:
                self.dropouts.append(interval)
                keep[rows] = False
        return keep, values, len(pose)

    def _decidable(self, stamp: IntArray, begins: IntArray, run: int) -> bool:
        """Whether the two poses after that of a run are known, or the first of them lasts."""
        if run + 2 < len(begins):
            return True
        return run + 1 < len(begins) and int(stamp[-1] - stamp[begins[run + 1]]) > LONGEST_HOLD

    def _is_stale(self, stamp: IntArray, pose: Array, begins: IntArray, run: int, values: Array) -> bool:
        """Whether the body moved on during a run: the change after it is too large for one interval."""
        if run + 2 >= len(begins):
            return False
        begin, now, later = (int(at) for at in begins[run : run + 3])
        change = float(np.linalg.norm(pose[now] - pose[begin]))
        rests = int(stamp[later - 1] - stamp[now]) > LONGEST_HOLD
        after = 0.0 if rests else _speed(stamp, pose, now, later)
        if change <= HARMLESS or change > CONTINUES * after * int(stamp[now] - stamp[begin]):
            return False
        before = _speed(stamp, pose, int(begins[run - 1]), begin) if run else 0.0
        one = MARGIN * max(after, before) * int(stamp[now] - stamp[now - 1])
        return change > HARMLESS + MARGIN * float(values[now, -1]) + one


def _speed(stamp: IntArray, pose: Array, first: int, last: int) -> float:
    """From one row of poses (n, k) to another, m/ns."""
    return float(np.linalg.norm(pose[last] - pose[first])) / int(stamp[last] - stamp[first])


# --- poses continued on a line ----------------------------------------------------------------------------------------


class ContinuedPoses(Portions):
    """Takes the samples of one stream in order and returns them without continued ones.

    A sample waits for the next one, those on a line for its end. The result does not depend on the portions. lost:
    number of continued samples; runs: of lines that they are on.
    """

    def __init__(self, angle: int | None) -> None:
        """Of a stream whose last column is the resolution, m; angle: index of one with an unwrapped heading, rad."""
        super().__init__()
        self.lost = self.runs = 0
        self._angle = angle

    def take(self, new: OrderedSamples, final: bool = False) -> OrderedSamples:
        """Add samples and return those that are decided; with `final` all are."""
        samples = self._with(new)
        pose, first = lengths(samples.values, self._angle), self._returned
        lost, decided = _judged(samples.stamp, pose, samples.values[:, -1], first)
        decided = len(lost) if final else max(decided, first)
        rows = np.arange(first, decided)
        self.lost += int(np.sum(lost[rows]))
        self.runs += int(np.sum(np.diff(lost[rows], prepend=False) & lost[rows]))
        kept = max(decided - JUDGING, 0)
        self._keep(samples, slice(kept, None), decided - kept)
        return taken(samples, rows[~lost[rows]])


def _judged(stamp: IntArray, pose: Array, quantum: Array, first: int) -> tuple[BoolArray, int]:
    """Which poses (n, k) are continued, and how many are decided if more can follow; first: of those that wait."""
    lost, count = np.zeros(len(pose), dtype=np.bool_), len(pose)
    off, moves = _off_line(stamp, pose)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], ((off < EXACT) & moves).astype(np.int8), [0]])))
    for begin, end in edges.reshape(-1, 2).tolist():
        if begin - 1 < first or stamp[end - 1] - stamp[begin - 1] > LONGEST:
            continue
        if (noise := _noise(off, begin - 1)) <= NOISE:  # the first of a run is off the line of those before
            continue
        if end == count:
            return lost, begin - 1
        if end - begin >= SHORTEST and quantum[end] <= NOISE and off[end] > CORRECTED * noise:
            lost[begin - 1 : end] = True
    return lost, count - 1


def _off_line(stamp: IntArray, pose: Array) -> tuple[Array, BoolArray]:
    """The distance (n,) m of each pose (n, k) from the line of the two before, and whether it moves."""
    off, moves = np.full(len(pose), np.inf), np.zeros(len(pose), dtype=np.bool_)
    if len(pose) > 2:
        step, interval = np.diff(pose, axis=0), np.diff(stamp).astype(np.float64)[:, None]
        ratio = interval[1:] / np.where(interval[:-1] == 0.0, np.nan, interval[:-1])
        off[2:] = _length(step[1:] - step[:-1] * ratio)
        moves[2:] = _length(step[1:]) > LEAST
    return np.where(np.isfinite(off), off, np.inf), moves


def _length(steps: Array) -> Array:
    """The lengths (n,) of steps (n, k): for few columns numpy's norm takes three times as long."""
    return np.asarray(np.sqrt(sum(column**2 for column in steps.T)))


def _noise(off: Array, first: int) -> float:
    """The median distance (m) from the line of the poses before a run, 0 for too few."""
    before = off[max(first - BEFORE, 0) : first]
    before = before[np.isfinite(before)]
    return float(np.median(before)) if len(before) >= BEFORE // 2 else 0.0
