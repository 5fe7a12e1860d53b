"""Finding hyperparameters by L-BFGS, first on a third of the rows, then, with what that taught, on all.

A third of the rows costs a 27th for each evaluation, and their minimum is near that of all rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from push_predictor.types import Array, IntArray

Cost = Callable[[Array], tuple[float, Array]]

_FEWEST_ROWS = 400
_PART = 3


@dataclass(frozen=True)
class Minimum:
    """Where a cost is lowest, and for each variable how far from there the cost is 1/2 higher, roughly; (D,) each."""

    point: Array
    width: Array


@dataclass(frozen=True)
class Descent:
    """How to go down: box (D, 2) of the variables; iterations at most; the relative decrease that ends it."""

    box: Array
    most_iterations: int
    stop: float

    def run(self, cost: Cost, first: Array) -> Minimum:
        """The minimum next to a point of the box."""
        options = {"maxiter": self.most_iterations, "ftol": self.stop}
        found = minimize(cost, first, jac=True, method="L-BFGS-B", bounds=self.box, options=options)
        return Minimum(found.x, np.sqrt(np.diagonal(found.hess_inv.todense())))

    def refine(self, cost: Cost, rough: Minimum) -> Minimum:
        """The minimum next to that of a third of the rows, in units that suit its first steps."""
        unit = rough.width / np.sqrt(_PART)

        def scaled(point: Array) -> tuple[float, Array]:
            value, gradient = cost(point * unit)
            return value, gradient * unit

        found = Descent(self.box / unit[:, None], self.most_iterations, self.stop).run(scaled, rough.point / unit)
        return Minimum(found.point * unit, found.width * unit)


def part_of_rows(n: int) -> IntArray | None:
    """Indices of the third to begin with; None where n rows are too few for that to pay."""
    return np.sort(np.random.default_rng(0).permutation(n)[: n // _PART]) if n >= _FEWEST_ROWS else None
