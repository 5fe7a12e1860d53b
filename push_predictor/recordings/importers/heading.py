# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Repair a tracker's heading: unwrap it and undo jumps that the slider's symmetry allows.

A tracker that confuses two markers reports a heading that is wrong by a multiple of 90 degrees from one frame on,
sometimes through a few intermediate frames. On a slider with this symmetry the jump can be undone. On other sliders
neither side of the jump is known to be right, and the stream is cut there.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from push_predictor.types import Array, BoolArray

QUARTER = np.pi / 2.0
LEAST_JUMP = 0.07  # rad between two samples; below it a step is motion or noise
FASTEST_TURN = 17.0  # rad/s: a pusher of 0.5 m/s on a lever of 3 cm
NEAR_QUARTER = 0.15  # rad: the slider may also turn during the jump


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
