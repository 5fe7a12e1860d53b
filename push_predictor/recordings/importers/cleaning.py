# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Repairs for several formats: order of time, repeated rows, repeated positions, jumps of a heading.

A tracker that confuses two markers reports a heading that is wrong by a multiple of 90 degrees from one frame on,
sometimes through a few intermediate frames. On a slider with this symmetry the jump can be undone. On other sliders
neither side of the jump is known to be right, and the stream is cut there.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from push_predictor.errors import ImportSourceError
from push_predictor.recordings.importers.staging import Notes
from push_predictor.types import Array, BoolArray, IntArray

LONGEST_STEP = 4  # rows
LAST_STAMP = 2**31 * 1_000_000_000  # ns; a ROS stamp has seconds of 31 bits
QUARTER = np.pi / 2.0
LEAST_JUMP = 0.07  # rad between two samples; below it a step is motion or noise
FASTEST_TURN = 17.0  # rad/s: a pusher of 0.5 m/s on a lever of 3 cm
NEAR_QUARTER = 0.15  # rad: the slider may also turn during the jump


class Samples(NamedTuple):
    """Rows of a stream before conversion: stamps (n,) in ns, values (n, k)."""

    stamp: IntArray
    values: Array

    def take(self, rows: IntArray | BoolArray) -> Samples:
        """The given rows."""
        return Samples(self.stamp[rows], self.values[rows])


def nanoseconds(seconds: Array) -> IntArray:
    """Unix seconds (n,) as integer ns."""
    whole = np.floor(np.clip(seconds, -1.0, 9e9))  # within 64 bits; values out of range are rejected later
    return whole.astype(np.int64) * 1_000_000_000 + np.round((seconds - whole) * 1e9).astype(np.int64)


def twist(z: Array, w: Array) -> Array:
    """The planar rotation (rad) nearest to a quaternion with these z and w; its tilt is treated as noise."""
    return np.asarray(2.0 * np.arctan2(z, w))


def in_order(samples: Samples, where: str, notes: Notes) -> Samples:
    """The finite samples in order of time, one per stamp.

    Raises ImportSourceError if fewer than two remain, or a stamp is outside the range of a message.
    """
    if np.any(wrong := (samples.stamp < 0) | (samples.stamp >= LAST_STAMP)):
        row = int(np.argmax(wrong))
        raise ImportSourceError(f"{where}[{row}]: time {samples.stamp[row] / 1e9:.9g} s, give Unix time before 2038")
    finite = np.all(np.isfinite(samples.values), axis=1)
    if missing := int(np.sum(~finite)):
        notes.dropped.append(f"{where}: {missing} rows that contain NaN or infinity")
        samples = samples.take(finite)
    if late := int(np.sum(np.diff(samples.stamp) < 0)):
        notes.repaired.append(f"{where}: {late} rows out of order in time; all rows were sorted")
        samples = samples.take(np.argsort(samples.stamp, kind="stable"))
    first = np.concatenate([[True], np.diff(samples.stamp) > 0])[: len(samples.stamp)]
    if repeated := int(np.sum(~first)):
        notes.dropped.append(f"{where}: {repeated} rows that repeat the stamp of the row before")
        samples = samples.take(first)
    if len(samples.stamp) < 2:
        raise ImportSourceError(f"{where}: {len(samples.stamp)} usable rows, give at least 2")
    return samples


def without_repeats(samples: Samples, where: str, notes: Notes) -> Samples:
    """The rows with new positions, of a robot that reports faster than it updates.

    Of several equal rows the first is a measurement. Where more than LONGEST_STEP rows are equal the tip rests, and
    rows at the update rate of the moving tip are kept.
    """
    fresh = np.concatenate([[True], np.any(samples.values[1:] != samples.values[:-1], axis=1)])
    starts = np.flatnonzero(fresh)
    length = np.diff(np.append(starts, len(fresh)))
    moving = length[length <= LONGEST_STEP]
    interval = int(np.median(moving)) if len(moving) else 1
    step = np.cumsum(fresh) - 1
    place = np.arange(len(fresh)) - starts[step]
    repeated = np.where(length[step] <= LONGEST_STEP, place > 0, place % interval > 0)
    if count := int(np.sum(repeated)):
        notes.repaired.append(
            f"{where}: {count} of {len(repeated)} rows repeat the tip's position in the row before; removed"
        )
    return samples.take(~repeated)


def require_overlap(streams: dict[str, IntArray], where: str) -> None:
    """Raise ImportSourceError unless all streams (stamps in ns) overlap in time."""
    start = max(int(stamp[0]) for stamp in streams.values())
    end = min(int(stamp[-1]) for stamp in streams.values())
    if start >= end:
        spans = ", ".join(f"{name} {stamp[0] / 1e9:.3f} to {stamp[-1] / 1e9:.3f} s" for name, stamp in streams.items())
        raise ImportSourceError(f"{where}: the streams do not overlap in time ({spans})")


@dataclass(frozen=True, eq=False)
class HeadingRepair:
    """heading (n,) rad, continuous; keep (n,): usable samples; undone, cut: numbers of jumps."""

    heading: Array
    keep: BoolArray
    undone: int
    cut: int


def repair_heading(time: Array, heading: Array, symmetry: int) -> HeadingRepair:
    """Undo jumps of the heading (n,) rad at times (n,) s.

    symmetry: order of the slider's rotational symmetry, 0 for a circle. If a jump cannot be undone, the longest piece
    without such a jump is kept.
    """
    heading = np.unwrap(heading)
    keep = np.ones(len(heading), dtype=np.bool_)
    cuts, undone = [0], 0
    for start, end in _fast_runs(time, heading):
        total = heading[end] - heading[start]
        quarters = int(np.round(total / QUARTER))
        if abs(total - quarters * QUARTER) > NEAR_QUARTER or not _looks_the_same(quarters, symmetry):
            cuts += [start + 1, end]
            continue
        heading[end:] -= quarters * QUARTER
        keep[start + 1 : end] = False
        undone += 1
    first, last = _longest(np.unique([*cuts, len(heading)]).tolist())
    keep[:first] = False
    keep[last:] = False
    return HeadingRepair(heading, keep, undone, (len(cuts) - 1) // 2)


def _looks_the_same(quarters: int, symmetry: int) -> bool:
    """Whether a slider of this symmetry is unchanged by a number of quarter turns."""
    return symmetry == 0 or quarters * symmetry % 4 == 0


def _fast_runs(time: Array, heading: Array) -> list[tuple[int, int]]:
    """Pairs of samples between which every step is faster than a slider can turn."""
    fast = np.abs(np.diff(heading)) > np.maximum(LEAST_JUMP, FASTEST_TURN * np.diff(time))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], fast.astype(np.int8), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _longest(bounds: list[int]) -> tuple[int, int]:
    return max(pairwise(bounds), key=lambda piece: piece[1] - piece[0])
