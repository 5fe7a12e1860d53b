# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Search for hyperparameters by L-BFGS, on at most MOST_SEARCHED rows: more rows determine little more."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array, IntArray

Cost = Callable[[Array], tuple[float, Array]]

MOST_SEARCHED = 350


@dataclass(frozen=True)
class Minimum:
    """A minimum of a cost: point (D,)."""

    point: Array
    cost: float


@dataclass(frozen=True)
class Descent:
    """A bounded minimisation: box (D, 2) of the variables, most iterations, relative decrease at which it ends."""

    box: Array
    most_iterations: int
    stop: float

    def run(self, cost: Cost, first: Array, unit: float = 1.0) -> Minimum:
        """The local minimum reached from a point of the box; unit: about the length of the first step."""
        from scipy.optimize import minimize  # its import would take every node 0.2 s at the start

        def scaled(point: Array) -> tuple[float, Array]:
            value, gradient = cost(point * unit)
            return value, gradient * unit

        options = {"maxiter": self.most_iterations, "ftol": self.stop}
        found = minimize(scaled, first / unit, jac=True, method="L-BFGS-B", bounds=self.box / unit, options=options)
        return Minimum(found.x * unit, float(found.fun))


def some_rows(n: int, most: int) -> IntArray:
    """Indices of at most this many of n rows, at random, but always the same."""
    return np.sort(np.random.default_rng(0).permutation(n)[:most])
