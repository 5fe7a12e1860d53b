# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The resolution of a stream, and poses of a coarse one, read from lines through the samples around each.

The resolution is the step in which numbers are written, by decimals or by counts of a sensor. Between two steps a
coordinate stands still and then jumps: neither its speed nor its place is that of the body. A line over several steps
has both. It spans as little as the resolution allows.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.recordings.dropouts import NANOSECOND, usual_interval
from push_predictor.recordings.streams import taken
from push_predictor.recordings.windows.stamp_order import OrderedSamples, Portions
from push_predictor.types import Array, IntArray

LEVER = 0.05  # m: a turn moves the outline of a slider by this for each radian
ROUNDING = 1e-9  # m, rad: smaller differences are those of floating-point numbers
EVIDENCE = 20  # changes of a coordinate's step before its resolution is known
VARYING = 0.25  # of the steps differ from the one before: those of a rounded motion do, those of a steady one do not
SPEED_ERROR = 0.0015  # m/s: of a line's slope, standard deviation; a slower tip counts as resting
SHORTEST, LONGEST = 0.020, 0.2  # s: a window's velocity is fitted over the one; the other is a window
KINK = 3.0  # times the mean square of rounding: what a line leaves where the motion changes, or jumps, within its span
AT_ONCE = 4096  # samples that get their lines at once: each needs its neighbours' in memory


class Resolution:
    """Takes samples of k columns in order; the resolution after each follows from those so far.

    All steps between numbers of a grid, and all differences of steps, are multiples of its resolution. Those of a
    measured number become arbitrarily small.
    """

    def __init__(self, width: int) -> None:
        self._last, self._step = np.full((1, width), np.nan), np.full((1, width), np.nan)
        self._least = np.full((1, width), np.inf)
        self._moves, self._changes = np.zeros((1, width)), np.zeros((1, width))

    def take(self, values: Array) -> Array:
        """The resolution (n, k) known after each of n samples (n, k); 0 while it is unknown."""
        if not len(values):
            return np.zeros_like(values)
        step = np.diff(values, axis=0, prepend=self._last)
        change = np.diff(step, axis=0, prepend=self._step)
        step_size, change_size = np.abs(step), np.abs(change)
        moved, changed = step_size > ROUNDING, change_size > ROUNDING
        smallest = np.minimum(np.where(moved, step_size, np.inf), np.where(changed, change_size, np.inf))
        least = np.minimum.accumulate(np.vstack([self._least, smallest]))[1:]
        moves, changes = self._moves + np.cumsum(moved, axis=0), self._changes + np.cumsum(changed, axis=0)
        self._last, self._step, self._least = values[-1:], step[-1:], least[-1:]
        self._moves, self._changes = moves[-1:], changes[-1:]
        return np.where((changes >= EVIDENCE) & (changes >= VARYING * moves), least, 0.0)


def changes(pose: Array) -> IntArray:
    """The samples whose pose, of n rows, is not that of the one before; the first is one."""
    return np.flatnonzero(np.append(True, np.any(pose[1:] != pose[:-1], axis=1))[: len(pose)])


def lengths(values: Array, angle: int | None) -> Array:
    """Positions (n, 2), the first columns of values (n, k), and the way (n, 1) of an outline that turns, all m.

    angle: index of the column with an unwrapped heading (rad), None without one.
    """
    return values[:, :2] if angle is None else np.column_stack([values[:, :2], LEVER * values[:, angle]])


# --- lines through poses of a coarse resolution -----------------------------------------------------------------------


def fit_span(quantum: Array | float, period: float) -> Array:
    """The span (s) over which a line through samples of a resolution (m) has a slope with an error of SPEED_ERROR.

    Rounding is an independent error of quantum / sqrt(12) at each sample; n = span / period samples leave the slope an
    error of sqrt(12 / n) / span times that.
    """
    return np.asarray((np.asarray(quantum) * np.sqrt(period) / SPEED_ERROR) ** (2.0 / 3.0))


class SmoothedPoses(Portions):
    """Takes the samples of one stream in order and returns them with smoothed positions and headings.

    Samples of a fine resolution are returned at once and unchanged; others wait for the span of a line. resolution: of
    the newest samples, m; 0 if it is fine.
    """

    def __init__(self, angle: int | None = None) -> None:
        """Of a stream with columns as Track passes them on; angle: index of one with a heading (rad)."""
        super().__init__()
        self._columns = [0, 1] if angle is None else [0, 1, angle]
        self.resolution = 0.0
        self._first: IntArray = np.empty(0, np.int64)  # stamps (ns) that determine the period
        self._half = np.empty(0)  # s, of the lines at these samples

    def take(self, new: OrderedSamples, final: bool = False) -> OrderedSamples:
        """Add samples and return those that are decided; with `final` all are."""
        self._first = np.concatenate([self._first, new.stamp])[: EVIDENCE + 1]
        samples = self._with(new)
        self._half = np.concatenate([self._half, self._halves(new.values)])
        stamp = samples.stamp
        complete = stamp + 2e9 * self._half < (stamp[-1] if len(stamp) else 0)
        waits = np.flatnonzero(~complete & (self._half > 0.0))
        end = len(stamp) if final or not len(waits) else max(int(waits[0]), self._returned)
        rows = np.arange(self._returned, end)
        values = samples.values[rows]
        if (coarse := self._half[rows] > 0.0).any():
            values[np.flatnonzero(coarse)[:, None], self._columns] = self._lines(samples, rows[coarse])
        found = replace(taken(samples, rows), values=values)
        begin = (
            int(np.searchsorted(stamp, (stamp[end] if end < len(stamp) else stamp[-1]) - 1e9 * LONGEST)) if end else 0
        )
        keep = slice(min(begin, end), None)
        self._keep(samples, keep, end - keep.start)
        self._half = self._half[keep]
        return found

    def _halves(self, values: Array) -> Array:
        """Half the span (n,) s of the lines at samples (n, k), 0 for a fine resolution."""
        span = fit_span(values[:, -1], usual_interval(self._first))
        if len(span):
            self.resolution = float(values[-1, -1]) if span[-1] > SHORTEST else 0.0
        return np.where(span > SHORTEST, 0.5 * np.minimum(span, LONGEST), 0.0)

    def _lines(self, samples: OrderedSamples, rows: IntArray) -> Array:
        """The values (m, c) of the smoothed columns at m samples, on least-squares lines through those around each.

        Where the motion has a kink in this span, on the line through those before or after that fits better.
        """
        stamp, values = samples.stamp, samples.values[:, self._columns]
        half = (1e9 * self._half[rows]).astype(np.int64)
        spans = ((half, half), (2 * half, 0), (0, 2 * half))
        first = [np.searchsorted(stamp, stamp[rows] - before) for before, _ in spans]
        last = [np.searchsorted(stamp, stamp[rows] + after, side="right") for _, after in spans]
        found, misfit = _lines_at(stamp, values, rows, first[0], last[0])
        rounding = samples.values[rows, -1] ** 2 / 12.0
        kinks = np.flatnonzero(self._total(misfit) > KINK * rounding)
        if len(kinks):
            sides = [_lines_at(stamp, values, rows[kinks], first[k][kinks], last[k][kinks]) for k in (1, 2)]
            least = np.argmin([self._total(of) for _, of in sides], axis=0)
            better = np.min([self._total(of) for _, of in sides], axis=0) < self._total(misfit[kinks]) / KINK
            found[kinks] = np.where(
                better[:, None], np.where(least[:, None] == 0, sides[0][0], sides[1][0]), found[kinks]
            )
        return found

    def _total(self, misfit: Array) -> Array:
        """The misfit (m,) m^2 of all columns, from their mean squares (m, c)."""
        return np.asarray(misfit @ np.array([1.0, 1.0, LEVER**2])[: len(self._columns)])


def _lines_at(stamp: IntArray, values: Array, rows: IntArray, first: IntArray, last: IntArray) -> tuple[Array, Array]:
    """The values (m, c) at m samples of the lines through those from each first to before each last.

    Also the mean square (m, c) of what a line leaves.
    """
    found, misfit = [], []
    for at in range(0, len(rows), AT_ONCE):
        part = slice(at, at + AT_ONCE)
        count, inside = (last - first)[part], part_rows(first[part], last[part])
        time = np.asarray((stamp[inside] - np.repeat(stamp[rows[part]], count)) * NANOSECOND)
        value, _, left = part_lines(time, values[inside], count)
        found.append(value)
        misfit.append(left)
    return np.concatenate(found), np.concatenate(misfit)


# --- means of, and lines through, many parts of a stream at once ------------------------------------------------------


def part_rows(first: IntArray, last: IntArray) -> IntArray:
    """The indices from each first to before each last, one after the other."""
    count = last - first
    return np.asarray(np.arange(int(count.sum())) + np.repeat(first - np.cumsum(count) + count, count))


def part_means(values: Array, count: IntArray) -> Array:
    """Means (n, k) of n consecutive parts of values (m, k), each of `count` (n,) > 0 rows."""
    return np.asarray(np.add.reduceat(values, np.cumsum(count) - count, axis=0) / count[:, None])


def part_lines(time: Array, values: Array, count: IntArray) -> tuple[Array, Array, Array]:
    """Least-squares lines through n parts of times (m,) s and values (m, k): values (n, k) at time 0 and slopes (n, k).

    Also the mean square (n, k) of what each line leaves.
    """
    mean_time, mean = part_means(time[:, None], count), part_means(values, count)
    late, off = time[:, None] - np.repeat(mean_time, count, axis=0), values - np.repeat(mean, count, axis=0)
    spread = part_means(late**2, count)
    slope = part_means(late * off, count) / np.where(spread > 0.0, spread, 1.0)
    misfit = part_means((off - np.repeat(slope, count, axis=0) * late) ** 2, count)
    return mean - slope * mean_time, slope, misfit
