# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Noise along a push: random deviations of load and friction that change as the tip travels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array

KNOT_SPACING = 0.004  # m travelled by the tip between two independent draws
PERSISTENT_SHARE = 0.2  # of the variance: stays the same for a whole push


@dataclass(frozen=True, eq=False)
class PushNoise:
    """Deviations of n pushes.

    persistent (n, k): constant over each push; knots (n, m, k): one every KNOT_SPACING metres.
    """

    persistent: Array
    knots: Array

    def at(self, travelled: Array) -> Array:
        """Deviations (n, k) after the tips travelled (n,) m.

        Their variance is the same between knots as at knots.
        """
        position = np.minimum(np.maximum(travelled / KNOT_SPACING, 0.0), self.knots.shape[1] - 1.001)
        index = position.astype(np.intp)
        phase = (np.pi / 2.0) * (position - index)[:, None]
        rows = np.arange(len(travelled))
        changing = np.cos(phase) * self.knots[rows, index] + np.sin(phase) * self.knots[rows, index + 1]
        return np.asarray(self.persistent + changing)

    def take(self, rows: np.ndarray) -> PushNoise:
        """The given pushes."""
        return PushNoise(self.persistent[rows], self.knots[rows])


def knot_count(length: float) -> int:
    """Number of knots for a path of `length` m."""
    return int(np.ceil(length / KNOT_SPACING)) + 2


def noise_from_draws(draws: Array) -> PushNoise:
    """Noise with the variance of independent draws (n, m + 1, k).

    The first draw is persistent, the others are the knots.
    """
    return PushNoise(np.sqrt(PERSISTENT_SHARE) * draws[:, 0], np.sqrt(1.0 - PERSISTENT_SHARE) * draws[:, 1:])
