"""Random deviations that change along a push: where slider, rod and table touch is never the same for long."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array

KNOT = 0.004  # m of the tip's way over which deviations change
LASTING = 0.2  # share of the variance that stays with a push from begin to end


@dataclass(frozen=True, eq=False)
class Scatter:
    """Deviations of n pushes: lasting (n, k) from begin to end, and knots (n, m, k), one every KNOT metres of way."""

    lasting: Array
    knots: Array

    def at(self, way: Array) -> Array:
        """Deviations (n, k) after way (n,) m; between knots with the variance that the knots have."""
        place = np.clip(way / KNOT, 0.0, self.knots.shape[1] - 1.001)
        index = place.astype(np.intp)
        share = (np.pi / 2.0) * (place - index)[:, None]
        rows = np.arange(len(way))
        passing = np.cos(share) * self.knots[rows, index] + np.sin(share) * self.knots[rows, index + 1]
        return np.asarray(self.lasting + passing)

    def take(self, rows: np.ndarray) -> Scatter:
        """The given pushes."""
        return Scatter(self.lasting[rows], self.knots[rows])


def no_scatter(n: int, k: int) -> Scatter:
    """Deviations that are zero."""
    return Scatter(np.zeros((n, k)), np.zeros((n, 2, k)))


def knots_for(length: float) -> int:
    """How many knots a way of `length` m needs."""
    return int(np.ceil(length / KNOT)) + 2


def mixed(draws: Array) -> Scatter:
    """Scatter of the variance of independent draws (n, m + 1, k): the first for what lasts, one for each knot."""
    return Scatter(np.sqrt(LASTING) * draws[:, 0], np.sqrt(1.0 - LASTING) * draws[:, 1:])
