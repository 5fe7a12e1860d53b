# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Poses between the samples of a slow stream: when a body started and stopped, and where it was meanwhile.

A straight line between the last sample at rest and the first in motion is wrong at both ends. The body rested until it
had to start to reach the second at the speed that it has afterwards; it stops likewise.
"""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.dropouts import NANOSECOND, longest_interval
from push_predictor.recordings.windows.resolution import lengths
from push_predictor.recordings.windows.stamp_order import OrderedSamples, joined, taken
from push_predictor.types import Array, BoolArray, IntArray

SLOW = 0.015  # s between samples of a slow stream
FINE = 10_000_000  # ns between the poses that are put in
USUAL = 9  # intervals whose median is the usual one
REST = 0.1  # of the speed afterwards, or before: slower is rest
FULL = 0.98  # of the same speed: a motion over nearly all of an interval needs no other pose
LEAST = 2e-4  # m in one interval: less is noise


class SlowPoses:
    """Takes the samples of one stream in order and returns them with poses between those of a slow stream.

    fill: put poses between all samples, for a body whose contact is asked for at each; else only at start and stop. A
    sample of a slow stream waits for the next.
    """

    def __init__(self, fill: bool, angle: int | None = None) -> None:
        """Of a stream with columns as Track passes them on; angle: index of one with a heading (rad)."""
        self._fill, self._angle = fill, angle
        self._samples: OrderedSamples | None = None  # those that wait, after USUAL before them
        self._returned = 0

    @property
    def waiting(self) -> int:
        """How many samples wait."""
        return 0 if self._samples is None else len(self._samples.stamp) - self._returned

    def take(self, new: OrderedSamples, final: bool = False) -> OrderedSamples:
        """Add samples and return those that are decided; with `final` all are."""
        samples = new if self._samples is None else joined(self._samples, new)
        slow = self._slow(samples)
        end = len(samples.stamp) - (0 if final or not len(slow) or not slow[-1] else 1)
        rows = np.arange(self._returned, max(end, self._returned))
        found = taken(samples, rows)
        if slow[rows].any():
            found = self._with_poses(samples, rows, slow)
        keep = max(len(samples.stamp) - USUAL - 2, 0)
        keep = min(keep, max(int(rows[-1]) + 1 if len(rows) else self._returned, 0))
        self._returned = (int(rows[-1]) + 1 if len(rows) else self._returned) - keep
        self._samples = taken(samples, slice(keep, None))
        return found

    def _slow(self, samples: OrderedSamples) -> BoolArray:
        """Whether the interval before each sample (n,) is a usual one of a slow stream."""
        interval = np.diff(samples.stamp, prepend=samples.stamp[:1]) * NANOSECOND
        found = np.zeros(len(interval), dtype=np.bool_)
        for k in np.flatnonzero((interval > SLOW) & ~samples.interrupted).tolist():
            if k > USUAL:
                usual = float(np.median(interval[k - USUAL + 1 : k + 1]))
                found[k] = usual > SLOW and interval[k] <= longest_interval(usual)
        return found

    def _with_poses(self, samples: OrderedSamples, rows: IntArray, slow: BoolArray) -> OrderedSamples:
        stamp, values = samples.stamp, samples.values
        stamps, poses = list[IntArray](), list[Array]()
        for k in rows.tolist():
            known, between = stamp[k : k + 1], values[k : k + 1]
            if slow[k]:
                knot = self._knot(stamp, values, k)
                known, between = _joint(known, between, knot)
                if self._fill:
                    known, between = _filled(np.append(stamp[k - 1], known), np.vstack([values[k - 1], between]))
            stamps.append(known)
            poses.append(between)
        count = np.array([len(of) for of in stamps])
        interrupted = np.zeros(int(count.sum()), dtype=np.bool_)
        interrupted[np.cumsum(count) - count] = samples.interrupted[rows]
        return OrderedSamples(np.concatenate(stamps), np.concatenate(poses), interrupted, samples.clock_set)

    def _knot(self, stamp: IntArray, values: Array, k: int) -> tuple[int, Array] | None:
        """Stamp (ns) and values of the start or the stop before sample k, None without one."""
        if k + 1 >= len(stamp):
            return None
        pose = lengths(values[k - 2 : k + 2], self._angle)
        interval = np.diff(stamp[k - 2 : k + 2])
        way = np.linalg.norm(np.diff(pose, axis=0), axis=1)
        before, now, after = way / interval
        if before < REST * after and after * interval[1] > LEAST and now < FULL * after:
            return int(stamp[k] - interval[1] * now / after), values[k - 1]
        if after < REST * before and before * interval[1] > LEAST and now < FULL * before:
            return int(stamp[k - 1] + interval[1] * now / before), values[k]
        return None


def _joint(stamp: IntArray, values: Array, knot: tuple[int, Array] | None) -> tuple[IntArray, Array]:
    if knot is None or knot[0] >= stamp[0]:
        return stamp, values
    return np.append(knot[0], stamp), np.vstack([knot[1], values])


def _filled(stamp: IntArray, values: Array) -> tuple[IntArray, Array]:
    """The samples after the first, with poses on the lines between them, at most FINE apart."""
    parts = [
        np.linspace(begin, end, int(-(-(end - begin) // FINE)) + 1)[1:].astype(np.int64)
        for begin, end in zip(stamp[:-1].tolist(), stamp[1:].tolist(), strict=True)
        if end > begin
    ]
    at = np.concatenate(parts)
    time = (stamp - stamp[0]).astype(np.float64)
    return at, np.column_stack([np.interp(at - stamp[0], time, column) for column in values.T])
