# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Smooth functions on a box: evaluated at few points, stored as cubic splines that are fast to evaluate.

An analytic function needs the fewest evaluations at Chebyshev nodes, where interpolation converges exponentially. A
cubic spline needs only 4 coefficients per axis for a value, but its knots must be dense: at a spacing h its error is
h^4 / 384 of the fourth derivative. So values at nodes are converted to values at knots, and those to coefficients of a
spline, axis by axis, by one matrix each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from push_predictor.models.tabulated.spline import spline_values
from push_predictor.types import Array, IntArray

_NOT_A_KNOT = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # no jump of the third derivative at the knot next to an end


@dataclass(frozen=True)
class Axis:
    """One side of a box, from low to high, divided into cells of equal length (3 at least)."""

    low: float
    high: float
    cells: int

    def nodes(self, count: int) -> Array:
        """Chebyshev nodes (count,) of this side."""
        return np.asarray(self.low + (self.high - self.low) * 0.5 * (1.0 + chebyshev.chebpts1(count)))

    def nodes_to_knots(self, count: int) -> Array:
        """Matrix (cells + 1, count) from values at the nodes to values at the ends of the cells."""
        at_nodes = chebyshev.chebvander(chebyshev.chebpts1(count), count - 1)
        at_knots = chebyshev.chebvander(np.linspace(-1.0, 1.0, self.cells + 1), count - 1)
        return np.asarray(np.linalg.solve(at_nodes.T, at_knots.T).T)

    def nodes_to_coefficients(self, count: int) -> Array:
        """Matrix (cells + 3, count) from values at the nodes to coefficients of the spline."""
        return _knots_to_coefficients(self.cells) @ self.nodes_to_knots(count)

    def coarse_to_coefficients(self, cells: int) -> Array:
        """Matrix (cells + 3, coarse cells + 1) from values at the knots of a coarse spline to coefficients of a fine
        one.
        """
        place = np.linspace(0.0, cells, self.cells + 1)
        cell = np.minimum(place.astype(np.int64), cells - 1)
        at_knots = np.zeros((self.cells + 1, cells + 3))
        for k, weight in enumerate(_weights(place - cell)):
            at_knots[np.arange(self.cells + 1), cell + k] = weight
        return _knots_to_coefficients(self.cells) @ at_knots @ _knots_to_coefficients(cells)


class TensorSpline:
    """Interpolating cubic splines of K functions on boxes that share their D axes; twice differentiable in each.

    coefficients (boxes, cells_1 + 3, ..., cells_D + 3, K), in single precision: half the memory, with an error that
    every comparison of a table with its model contains.
    """

    def __init__(self, axes: Sequence[Axis], coefficients: Array) -> None:
        self.axes = tuple(axes)
        self.coefficients = np.ascontiguousarray(coefficients, dtype=np.float32)
        self._rows = self.coefficients.reshape(-1, coefficients.shape[-1])
        self._low = np.array([axis.low for axis in axes])
        self._per_unit = np.array([axis.cells / (axis.high - axis.low) for axis in axes])
        self._cells = np.array([axis.cells for axis in axes], dtype=np.intp)

    @property
    def knots(self) -> int:
        """How many knots there are, in all boxes."""
        return len(self.coefficients) * int(np.prod([axis.cells + 1 for axis in self.axes]))

    def __call__(self, points: Array, box: IntArray) -> Array:
        """Values (n, K) at points (n, D) within the axes, each in its box (n,)."""
        values = np.empty((len(points), self._rows.shape[1]))
        spline_values(points, box, self._low, self._per_unit, self._cells, self._rows, values)
        return values


def _weights(u: Array) -> list[Array]:
    """The four cubic B-splines that are not zero at the place u of a cell, 0 to 1."""
    v = 1.0 - u
    uu, vv = u * u, v * v
    return [vv * v / 6.0, (4.0 - 6.0 * uu + 3.0 * uu * u) / 6.0, (4.0 - 6.0 * vv + 3.0 * vv * v) / 6.0, uu * u / 6.0]


def along_all(matrices: Sequence[Array], values: Array) -> Array:
    """Values (boxes, k_1, ..., k_D) with a matrix (m_d, k_d) applied along each axis but the first."""
    for axis, matrix in enumerate(matrices, 1):
        values = np.moveaxis(np.tensordot(matrix, values, axes=(1, axis)), 0, axis)
    return values


def _knots_to_coefficients(cells: int) -> Array:
    """Matrix (cells + 3, cells + 1): the spline takes the values, and has no knot next to an end."""
    equations = np.zeros((cells + 3, cells + 3))
    rows = np.arange(cells + 1)
    for k, weight in enumerate(_weights(np.zeros(()))[:3]):
        equations[rows + 1, rows + k] = weight
    equations[0, :5] = equations[-1, -5:] = _NOT_A_KNOT
    return np.asarray(np.linalg.inv(equations)[:, 1:-1])
