# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Undo flips of the heading: a tracker that mistakes symmetric markers for each other turns the body by a fixed angle.

A body that stays in its place cannot turn by a fixed angle between two samples: the heading continues from before.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from push_predictor.types import Array, BoolArray, IntArray

# rad: turns that map 2 to 6, or 8, equal markers onto each other
FIXED = np.unique([np.round(2.0 * np.pi * turn / parts, 12) for parts in (4, 5, 6, 8) for turn in range(1, parts)])
NEAR = 0.05  # rad from a fixed angle; a pushed body turns less between two samples
STAYS, SPEED = 0.001, 0.2  # m, m/s: a body that moves no farther between two samples stays in its place
LONGEST_STEP = 150_000_000  # ns between two samples: in a longer time a body can have been turned
LASTING = 1_000_000_000  # ns after which a body that seems flipped has this heading: the one before was the flip


class HeadingFlips:
    """Takes poses in order of arrival and returns headings without flips, each from what came before alone.

    A gap, or a place elsewhere, ends a flip: the heading counts as measured from there on.
    """

    def __init__(self) -> None:
        self._last: tuple[int, Array] | None = None  # stamp, and pose as measured
        self._turned, self._since = 0.0, 0  # rad by which the heading is flipped, and since which stamp (ns)

    def take(self, stamp: IntArray, pose: Array) -> Array:
        """The angles (n,) rad by which poses (n, 3), with stamps (n,) in ns, are flipped; 0 without a flip."""
        found = np.zeros(len(stamp))
        if not len(stamp):
            return found
        before = self._last or (int(stamp[0]), pose[0])
        turn, elsewhere = flip_steps(np.append(before[0], stamp), np.vstack([before[1], pose]))
        self._last = int(stamp[-1]), pose[-1]
        begins = np.union1d(0, np.flatnonzero((turn != 0.0) | elsewhere)).tolist()
        for begin, end in pairwise([*begins, len(stamp)]):
            self._change(int(stamp[begin]), float(turn[begin]), bool(elsewhere[begin]))
            lasting = begin + int(np.searchsorted(stamp[begin:end], self._since + LASTING))
            found[begin:lasting] = self._turned
            if lasting < end:
                self._turned = 0.0
        return found

    def _change(self, stamp: int, turn: float, elsewhere: bool) -> None:
        total = 0.0 if elsewhere else self._turned + turn
        total = 0.0 if abs(math.remainder(total, 2.0 * math.pi)) < NEAR else total
        if self._turned == 0.0:
            self._since = stamp
        self._turned = total


def flip_steps(stamp: IntArray, pose: Array) -> tuple[Array, BoolArray]:
    """What happens between n poses (n, 3) with stamps (n,) in ns, each (n - 1,).

    The fixed angle (rad) by which the body flips, 0 for none; and whether it may be elsewhere, or a gap lies between.
    """
    step, elapsed = np.diff(pose, axis=0), np.abs(np.diff(stamp))
    elsewhere = (elapsed > LONGEST_STEP) | (np.hypot(step[:, 0], step[:, 1]) > STAYS + SPEED * 1e-9 * elapsed)
    turn, found = np.mod(step[:, 2], 2.0 * np.pi), np.zeros(len(step))
    rows = np.flatnonzero(~elsewhere & (turn > FIXED[0] - NEAR) & (turn < FIXED[-1] + NEAR))  # few, if any
    nearest = FIXED[np.argmin(np.abs(turn[rows, None] - FIXED), axis=1)]
    found[rows] = np.where(np.abs(turn[rows] - nearest) < NEAR, nearest, 0.0)
    return found, elsewhere
