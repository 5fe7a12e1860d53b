# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Poses that a tracker did not measure, but continued with the last velocity while it did not see the body.

They lie exactly on a line, which the next measured pose leaves; poses measured with noise never do. A stream without
noise, as of a simulation, is left as it is: a body may move on a line. So are poses between two measured ones.
"""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.streams import PoseStream
from push_predictor.recordings.windows.repairs.resolution import LEVER, Resolution
from push_predictor.types import Array, BoolArray

EXACT = 1e-8  # m off the line of the two poses before: rounding of a continued pose
NOISE = 1e-5  # m off it, as the median of the BEFORE poses before a run: less may be a motion without noise
BEFORE = 20
SHORTEST = 4  # poses in a run: a coincidence of so many does not happen
CORRECTED = 3.0  # times this noise, of the next measured pose off the line: else the body is where the line leads
LEAST = 1e-5  # m in an interval: a body at rest repeats its pose


def continued(stream: PoseStream, angle: bool) -> BoolArray:
    """Which poses (n,) of a stream are continued, not measured; angle: whether its headings count."""
    columns = [stream.x, stream.y, *([LEVER * np.unwrap(stream.heading)] if angle else [])]
    pose, found = np.column_stack(columns), np.zeros(len(stream), dtype=np.bool_)
    if not len(pose):
        return found
    off, moves = _off_line(stream, pose)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], ((off < EXACT) & moves).astype(np.int8), [0]])))
    for begin, end in edges.reshape(-1, 2).tolist():
        noise = _noise(off, begin - 1)
        if end - begin >= SHORTEST and noise > NOISE and end < len(off) and off[end] > CORRECTED * noise:
            found[begin - 1 : end] = True  # the first one is off the line of the measured ones before
    if found.any() and np.max(Resolution(pose.shape[1]).take(pose)[-1]) > NOISE:  # rounded poses may lie on a line
        return np.zeros(len(stream), dtype=np.bool_)
    return found


def _off_line(stream: PoseStream, pose: Array) -> tuple[Array, BoolArray]:
    """The distance (n,) m of each pose (n, k) from the line of the two before, and whether it moves."""
    off, moves = np.full(len(pose), np.inf), np.zeros(len(pose), dtype=np.bool_)
    if len(pose) > 2:
        step, interval = np.diff(pose, axis=0), np.diff(stream.stamp).astype(np.float64)[:, None]
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
