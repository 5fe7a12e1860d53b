# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the sensor of the force reads without contact: in free motion, and before any at rest near the slider."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from push_predictor.types import Array, BoolArray, IntArray

TARE_SAMPLES = 30


class Zero(NamedTuple):
    """Mean (x, y) N of the readings, None before any, and their noise, N."""

    mean: tuple[float, float] | None
    noise: float


class ForceZero:
    """Takes the samples in portions; the zero at a sample is that of the last TARE_SAMPLES readings up to it."""

    def __init__(self) -> None:
        self._free: Array = np.empty((0, 2))  # readings (m, 2) in free motion: the last before the portion, and its own
        self._count: IntArray = np.empty(0, dtype=np.int64)  # of them up to each sample of the portion
        self._resting: deque[tuple[float, float]] = deque(maxlen=TARE_SAMPLES)
        self._known: dict[int, Zero] = {}  # by the number of readings in free motion

    def add(self, force: Array, free: BoolArray) -> BoolArray:
        """Begin a portion of forces (n, 2); free (n,): those in free motion. Returns whether any came up to each."""
        before = self._free[-TARE_SAMPLES:]
        self._free = np.concatenate([before, force[free]])
        self._count = len(before) + np.cumsum(free)
        self._known = {}
        return np.asarray(self._count > 0)

    def rest(self, force: tuple[float, float]) -> None:
        """Add a reading at rest near the slider, which counts until there is one in free motion."""
        self._resting.append(force)
        self._known.pop(0, None)

    def readings(self, sample: int) -> Array:
        """The readings (m, 2) N in free motion at a sample of the portion."""
        return self._last(int(self._count[sample]))

    def at(self, sample: int) -> Zero:
        """The zero at a sample of the portion."""
        return self._of(int(self._count[sample]))

    def above(self, force: Array, samples: IntArray) -> tuple[Array, Array]:
        """Sizes (m,) N of forces (n, 2) over the zero at m samples in order, and its noise (m,) there, N."""
        counts, which = np.unique(self._count[samples], return_inverse=True)
        zeros = [self._of(count) for count in counts.tolist()]
        mean = np.array([zero.mean or (0.0, 0.0) for zero in zeros]).reshape(-1, 2)
        off = force[samples] - mean[which]
        return np.hypot(off[:, 0], off[:, 1]), np.array([zero.noise for zero in zeros])[which]

    def _last(self, count: int) -> Array:
        return self._free[max(count - TARE_SAMPLES, 0) : count]

    def _of(self, count: int) -> Zero:
        if count not in self._known:
            readings = self._last(count) if count else np.array(self._resting)
            if len(readings):
                x, y = readings.mean(axis=0).tolist()
                self._known[count] = Zero((x, y), float(np.hypot(*readings.std(axis=0))))
            else:
                self._known[count] = Zero(None, 0.0)
        return self._known[count]
