# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The resolution of a stream: the step in which its numbers are written, by decimals or by counts of a sensor."""

from __future__ import annotations

import numpy as np

from push_predictor.types import Array, IntArray

LEVER = 0.05  # m: a turn moves the outline of a slider by this for each radian
ROUNDING = 1e-9  # m, rad: smaller differences are those of floating-point numbers
EVIDENCE = 20  # changes of a coordinate's step before its resolution is known
VARYING = 0.25  # of the steps differ from the one before: those of a rounded motion do, those of a steady one do not


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
