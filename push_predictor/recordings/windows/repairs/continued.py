# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Poses that a tracker did not measure, but continued with the last velocity while it did not see the body.

They lie exactly on a line, which the next measured pose leaves; poses measured with noise never do. A stream without
noise, as of a simulation, is left as it is: a body may move on a line. So are poses between two measured ones.
"""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.streams import PoseStream
from push_predictor.recordings.windows.repairs.resolution import LEVER, Resolution, lengths
from push_predictor.recordings.windows.stamp_order import OrderedSamples, joined, taken
from push_predictor.types import Array, BoolArray, IntArray

EXACT = 1e-8  # m off the line of the two poses before: rounding of a continued pose
NOISE = 1e-5  # m off it, as the median of the BEFORE poses before a run: less may be a motion without noise
BEFORE = 20
SHORTEST = 4  # poses in a run: a coincidence of so many does not happen
LONGEST = 2_000_000_000  # ns: a tracker gives a body up before
CORRECTED = 3.0  # times this noise, of the next measured pose off the line: else the body is where the line leads
LEAST = 1e-5  # m in an interval: a body at rest repeats its pose
JUDGING = BEFORE + 2  # poses before a run, of which the last BEFORE have two before them


class ContinuedPoses:
    """Takes the samples of one stream in order and returns them without continued ones.

    A sample waits for the next one, those on a line for its end. The result does not depend on the portions.
    """

    def __init__(self, angle: int | None) -> None:
        """Of a stream whose last column is the resolution, m; angle: index of one with an unwrapped heading, rad."""
        self._angle = angle
        self._samples: OrderedSamples | None = None  # those that judge, then those that wait
        self._returned = 0  # of these samples

    @property
    def waiting(self) -> int:
        """How many samples wait."""
        return 0 if self._samples is None else len(self._samples.stamp) - self._returned

    def take(self, new: OrderedSamples, final: bool = False) -> OrderedSamples:
        """Add samples and return those that are decided; with `final` all are."""
        samples = new if self._samples is None else joined(self._samples, new)
        pose, first = lengths(samples.values, self._angle), self._returned
        lost, decided = _judged(samples.stamp, pose, samples.values[:, -1], first)
        decided = len(lost) if final else max(decided, first)
        rows = np.arange(first, decided)
        kept = max(decided - JUDGING, 0)
        self._samples, self._returned = taken(samples, slice(kept, None)), decided - kept
        return taken(samples, rows[~lost[rows]])


def continued(stream: PoseStream, angle: bool) -> BoolArray:
    """Which poses (n,) of a stream are continued, not measured; angle: whether its headings count."""
    pose = np.column_stack([stream.x, stream.y, *([LEVER * np.unwrap(stream.heading)] if angle else [])])
    return _judged(stream.stamp, pose, np.max(Resolution(pose.shape[1]).take(pose), axis=1, initial=0.0), 0)[0]


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
