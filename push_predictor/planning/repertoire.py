# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Outcomes of many pushes in the slider's frame: computed once, valid at every pose of the slider."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import norm, qmc

from push_predictor.errors import RequestError
from push_predictor.planning.unscented import (
    FLOOR,
    Predict,
    PusherGeometry,
    initial_points,
    moments,
    propagate,
    tip_lines,
)
from push_predictor.types import Array, BoolArray, IntArray

DRAWS = 256  # samples of each outcome


@dataclass(frozen=True, eq=False)
class StraightPushes:
    """n straight pushes: inputs (n, 3: velocity m/s, contact, angle rad) at the start, number of windows (n,)."""

    inputs: Array
    windows: IntArray

    def __len__(self) -> int:
        return len(self.windows)

    def take(self, rows: IntArray | BoolArray) -> StraightPushes:
        """The given rows (indices or mask)."""
        return StraightPushes(self.inputs[rows], self.windows[rows])


def push_grid(velocities: Sequence[float], contacts: Array, angles: Array) -> Array:
    """Inputs (n, 3) of the grid of all velocities (m/s), contacts and angles (rad)."""
    grids = np.meshgrid(velocities, contacts, angles, indexing="ij")
    return np.column_stack([grid.ravel() for grid in grids])


@dataclass(frozen=True, eq=False)
class Repertoire:
    """Pushes with their outcomes: displacement of the slider in its body frame before the push.

    mean (n, 3: m, m, rad), covariance (n, 3, 3).
    """

    pushes: StraightPushes
    mean: Array
    covariance: Array

    def __len__(self) -> int:
        return len(self.mean)

    @cached_property
    def outcomes(self) -> Array:
        """Sobol samples (n, DRAWS, 3) of each outcome; the first 16, 32 or 64 also cover it evenly."""
        factor = np.linalg.cholesky(self.covariance + FLOOR * np.eye(3))
        points = norm.ppf(qmc.Sobol(3, seed=0).random(DRAWS))
        return np.asarray(self.mean[:, None] + points @ np.swapaxes(factor, 1, 2))


def repertoire(
    predict: Predict, pusher: PusherGeometry, inputs: Array, windows: Sequence[int], persistent_fraction: float = 0.0
) -> Repertoire:
    """Outcomes of straight pushes that begin with inputs (n, 3), each with every number of windows.

    Pushes that may leave the model's domain or the slider before their last window ends are dropped. predict: mean,
    covariance and in_domain of one window for inputs (m, 3); it is called with angles within ±pi/2 only.
    persistent_fraction: share of a window's covariance that is the same in all windows of a push (persistence.py).
    Raises RequestError for inputs that are not finite, a fraction outside [0, 1], and if no push remains.
    """
    if not np.all(np.isfinite(inputs)):
        raise RequestError("inputs", "NaN or infinite", "finite velocities, contacts and angles")
    if not 0.0 <= persistent_fraction <= 1.0:
        raise RequestError("persistent_fraction", persistent_fraction, "a number from 0 to 1")
    lines = tip_lines(pusher, inputs)
    rows, points = np.arange(len(inputs)), initial_points(len(inputs))
    ended: list[tuple[IntArray, IntArray, Array]] = []
    for window in range(max(windows, default=0)):
        stays, points = propagate(predict, lines.take(rows), points, window, persistent_fraction)
        rows = rows[stays]
        if window + 1 in windows:
            ended.append((rows, np.full(len(rows), window + 1), points[..., :3]))
    if not sum(len(of_length) for of_length, *_ in ended):
        raise RequestError("pushes", len(inputs) * len(windows), "at least one that stays in the model's domain")
    order, lengths, poses = (np.concatenate(column) for column in zip(*ended, strict=True))
    return Repertoire(StraightPushes(inputs[order], lengths), *moments(poses))
