# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Poses between the samples of a slow stream: when a body started and stopped, and where it was meanwhile.

A straight line between the last sample at rest and the first in motion is wrong at both ends. The body rested until it
had to start to reach the second at the speed that it has afterwards; it stops likewise.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from push_predictor.recordings.dropouts import DROPOUT_PERIODS, NANOSECOND, SHORTEST_DROPOUT
from push_predictor.recordings.streams import joined, taken
from push_predictor.recordings.windows.resolution import lengths
from push_predictor.recordings.windows.stamp_order import IsJump, OrderedSamples, Portions
from push_predictor.types import Array, BoolArray, IntArray

SLOW = 0.015  # s between samples of a slow stream
UNCERTAIN = 30e6  # ns between samples, from which a start or a stop between them matters more than their noise
FINE = 10_000_000  # ns between the poses that are put in
USUAL = 9  # intervals whose median is the usual one
REST = 0.1  # of the velocity on the other side: a body with less of it rests, or turned back
FULL = 0.98  # of the same speed: a motion over nearly all of an interval needs no other pose
LEAST = 2e-4  # m in one interval: less is noise


class SlowPoses(Portions):
    """Takes the samples of one stream in order and returns them with poses between those of a slow stream.

    Those of a body with a heading, whose contact is asked for at each pose, are put between all samples; of the tip,
    only at start and stop. A sample of a slow stream waits for the next.
    """

    def __init__(self, is_jump: IsJump, angle: int | None = None) -> None:
        """Of a stream with columns as Track passes them on; angle: index of one with a heading (rad)."""
        super().__init__()  # keeps those that show the usual interval
        self._is_jump = is_jump
        self._angle = angle

    def take(self, new: OrderedSamples, final: bool = False) -> OrderedSamples:
        """Add samples and return those that are decided; with `final` all are."""
        samples = self._with(new)
        slow = self._slow(samples)
        end = len(samples.stamp) - (0 if final or not len(slow) or not slow[-1] else 1)
        found = taken(samples, slice(self._returned, end))
        if slow[self._returned : end].any():
            first = max(self._returned, 1)
            before = taken(samples, slice(self._returned, first))
            found = joined([before, self._with_poses(samples, np.arange(first, end), slow)])
        keep = max(len(samples.stamp) - USUAL - 3, 0)
        self._keep(samples, slice(keep, None), end - keep)
        return found

    def _slow(self, samples: OrderedSamples) -> BoolArray:
        """Whether the interval before each sample (n,) is a usual one of a slow stream."""
        interval = np.diff(samples.stamp) * NANOSECOND
        found = np.zeros(len(samples.stamp), dtype=np.bool_)
        rows = USUAL + np.flatnonzero(interval[USUAL:] > SLOW)
        if len(rows):
            usual, last = np.median(sliding_window_view(interval, USUAL)[rows - USUAL + 1], axis=1), interval[rows]
            slow = (usual > SLOW) & (last <= np.maximum(SHORTEST_DROPOUT, DROPOUT_PERIODS * usual))
            jumps = self._is_jump(samples.values[rows], samples.values[rows + 1], last)
            found[rows + 1] = slow & ~samples.interrupted[rows + 1] & ~jumps
        return found

    def _with_poses(self, samples: OrderedSamples, rows: IntArray, slow: BoolArray) -> OrderedSamples:
        """The samples in these consecutive rows, with the poses that are put in before those of a slow stream."""
        before = np.arange(int(rows[0]) - 1, int(rows[-1]) + 1)
        stamp, values, slowly = samples.stamp[before], samples.values[before], slow[before]
        at, joint, knots = _knots(samples, rows[slow[rows]], slow, self._angle)
        at = at - before[0]
        time, pose = np.insert(stamp, at, joint), np.insert(values, at, knots, axis=0)
        parts = np.ones(len(time) - 1, dtype=np.int64)
        if self._angle is not None:
            parts = np.where(np.insert(slowly, at, True)[1:], -(-np.diff(time) // FINE), 1)
        end = np.cumsum(parts)
        part = np.arange(1, int(end[-1]) + 1) - np.repeat(end - parts, parts)
        stamps = np.repeat(time[:-1], parts) + np.repeat(np.diff(time), parts) * part // np.repeat(parts, parts)
        measured = end[np.searchsorted(time, stamp[1:]) - 1] - 1
        interrupted = np.zeros(len(stamps), dtype=np.bool_)
        interrupted[measured] = samples.interrupted[rows]
        known = (time - time[0]).astype(np.float64)
        poses = np.column_stack([np.interp((stamps - time[0]).astype(np.float64), known, of) for of in pose.T])
        return OrderedSamples(stamps, poses, interrupted)


def _knots(
    samples: OrderedSamples, rows: IntArray, slow: BoolArray, angle: int | None
) -> tuple[IntArray, IntArray, Array]:
    """Starts and stops before some samples: the sample's index, their stamps (ns) and values.

    slow (n,): the intervals before each of the n samples that are usual ones: over a break nothing moves.
    """
    stamp, values = samples.stamp, samples.values
    interval = np.diff(stamp).astype(np.float64)
    rows = rows[rows + 1 < len(stamp)]
    rows = rows[interval[rows - 1] > UNCERTAIN]
    velocity = np.diff(lengths(values, angle), axis=0) / interval[:, None]
    before, now, after = velocity[rows - 2], velocity[rows - 1], velocity[rows]
    stop, start = _share(now, before, after), _share(now, after, before)
    way = interval[rows - 1]
    stops = slow[rows - 1] & (stop < FULL) & (np.linalg.norm(before, axis=1) * way > LEAST)
    starts = slow[rows + 1] & (start < FULL) & (np.linalg.norm(after, axis=1) * way > LEAST) & ~stops
    joint = np.where(stops, stamp[rows - 1] + np.rint(stop * way), stamp[rows] - np.rint(start * way)).astype(np.int64)
    found = (starts | stops) & (joint > stamp[rows - 1]) & (joint < stamp[rows])
    return rows[found], joint[found], np.where(starts[:, None], values[rows - 1], values[rows])[found]


def _share(now: Array, moving: Array, other: Array) -> Array:
    """The share of an interval in which a body moves as in the one next to it, 1 where it does so on the other side.

    now, moving, other: mean velocities (n, k) in the interval, and on both sides of it.
    """
    square = np.sum(moving**2, axis=1)
    square = np.where(square > 0.0, square, 1.0)
    share, still = np.sum(now * moving, axis=1) / square, np.sum(other * moving, axis=1) / square
    return np.asarray(np.where((share > 0.0) & (still < REST), share, 1.0))
