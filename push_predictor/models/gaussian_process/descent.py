# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Search for hyperparameters by L-BFGS, first on a third of the rows, then from there on all rows.

An evaluation on a third of the rows costs a 27th, and its minimum is close to that of all rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array, IntArray

Cost = Callable[[Array], tuple[float, Array]]

_FEWEST_ROWS = 400
_PART = 3


@dataclass(frozen=True)
class Minimum:
    """A minimum of a cost: point (D,), and the distance (D,) in each variable at which the cost is about 1/2 higher."""

    point: Array
    width: Array
    cost: float


@dataclass(frozen=True)
class Descent:
    """A bounded minimisation: box (D, 2) of the variables, most iterations, relative decrease at which it ends."""

    box: Array
    most_iterations: int
    stop: float

    def run(self, cost: Cost, first: Array, unit: Array | float = 1.0) -> Minimum:
        """The local minimum reached from a point of the box; unit: about the length of the first step."""
        from scipy.optimize import minimize  # its import would take every node 0.2 s at the start

        def scaled(point: Array) -> tuple[float, Array]:
            value, gradient = cost(point * unit)
            return value, gradient * unit

        options = {"maxiter": self.most_iterations, "ftol": self.stop}
        box = (self.box.T / unit).T
        found = minimize(scaled, first / unit, jac=True, method="L-BFGS-B", bounds=box, options=options)
        width = np.sqrt(np.diagonal(found.hess_inv.todense()))
        return Minimum(found.x * unit, width * unit, float(found.fun))

    def refine(self, cost: Cost, rough: Minimum) -> Minimum:
        """The local minimum reached from that of a third of the rows, in units that suit the first steps."""
        return self.run(cost, rough.point, rough.width / np.sqrt(_PART))


def part_of_rows(n: int) -> IntArray | None:
    """Indices of a third of n rows to begin with; None if n is too small for that to save time."""
    return np.sort(np.random.default_rng(0).permutation(n)[: n // _PART]) if n >= _FEWEST_ROWS else None
