# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Predictions of a learnt model tabulated over a box: their cost does not depend on the number of training rows.

Per output: the mean and the variance of f, and the log process variance, which is what is smooth: the variance of f has
narrow dips at the training pushes, of quadratic shape. Each posterior is evaluated at Chebyshev nodes as dense as its
lengthscales need. A correlation of the outputs is evaluated at coarser knots of its own, as the three numbers of
partial_correlation. All share the knots of one spline. The values at the nodes determine it, and take a twentieth of
its memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import TypeAlias

import numpy as np

from push_predictor.errors import PushPredictorError
from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.regression import ConstantNoise, Regression
from push_predictor.models.gaussian_process.sparse.vhgp import SparseVHGP
from push_predictor.models.predictors import GaussianProcessPredictor, Moments
from push_predictor.models.predictors.correlation import Correlation, correlations
from push_predictor.models.tabulated.grid_posterior import (
    GridPosterior,
    GridRegression,
    grid_regression,
    sparse_grid_regression,
    weighted_sums,
)
from push_predictor.models.tabulated.interpolation import Axis, TensorSpline, along
from push_predictor.models.tabulated.push_chart import Chart, Side, table_sides
from push_predictor.models.tabulated.spline import table_moments
from push_predictor.types import Array, IntArray

OnGrid: TypeAlias = GridRegression | ConstantNoise

MOST_KNOTS = 2_000_000  # 96 MB
MOST_NODES = 150_000  # of one posterior and edge: some seconds
FEWEST_NODES = 10
FEWEST_CELLS = 16


@dataclass(frozen=True)
class Density:
    """Nodes and cells per lengthscale."""

    nodes: float
    cells: float


SIGNAL = Density(
    nodes=4.0, cells=12.0
)  # f must be accurate to a small fraction of the noise, the noise to one of itself
NOISE = Density(nodes=2.5, cells=6.0)
COUPLING_CELLS = 3.0  # per bandwidth of the correlation


class TooFineError(PushPredictorError):
    """A model varies too fast for a table of a reasonable size, or its kernels allow none."""


@dataclass(frozen=True, eq=False)
class TableNodes:
    """What is computed of a model for its table.

    cells, coarse: of each axis of the spline, and of the spline of a correlation; least: lower bounds of the variances
    of f; values: per output, mean and variance of f and log process variance at the nodes, SI units, each (boxes,
    nodes_1, ...).
    """

    cells: list[int]
    coarse: list[int]
    least: list[float]
    values: list[Array]


@dataclass(frozen=True, eq=False)
class PredictionTable:
    """A table of predictions.

    columns: which of velocity, place and angle the splines depend on; knots: their total number; nodes: what the
    splines were computed from.
    """

    spline: TensorSpline
    columns: slice
    knots: int
    nodes: TableNodes

    @property
    def least(self) -> list[float]:
        """Lower bounds of the variances of f."""
        return self.nodes.least

    def moments(self, points: Array, box: IntArray) -> Moments:
        """Moments in SI units at points (n, 3: velocity, place, angle) in boxes (n,)."""
        values = self.spline(np.ascontiguousarray(points[:, self.columns]), box)
        covariance, process = np.empty((2, len(points), 3, 3))
        table_moments(values, self._least, covariance, process)
        return Moments(values[:, :3], covariance, process)

    @cached_property
    def _least(self) -> Array:
        return np.array(self.least, dtype=np.float64)


def tabulate(
    predictor: GaussianProcessPredictor,
    posteriors: Sequence[OnGrid],
    chart: Chart,
    low: Array,
    high: Array,
    refinement: float = 1.0,
) -> PredictionTable:
    """The table over the box of velocity, place and angle from low (3,) to high (3,).

    posteriors: of the predictor's regressions, see on_grid. refinement: factor on the usual number of nodes and knots
    along each axis. Raises TooFineError.
    """
    sides = table_sides(predictor.scaling, chart, low, high)
    resolved, correlation = _resolved(posteriors, predictor.correlation), predictor.correlation
    cells = [_cells(side, resolved, refinement) for side in sides]
    knots = chart.boxes * int(np.prod([count + 1.0 for count in cells]))
    if knots > MOST_KNOTS:
        raise TooFineError(f"{knots} knots would be needed, at most {MOST_KNOTS} are allowed")
    coupled = [(correlation.kernel, COUPLING_CELLS)] if correlation else []
    coarse = [_cells(side, coupled, refinement) for side in sides] if correlation else []
    least = predictor.reported_sd**2 * [_least_variance(regression) for regression in posteriors]
    values = _values(_Grid(sides, refinement), predictor, posteriors)
    return from_nodes(TableNodes(cells, coarse, least.tolist(), values), predictor, chart, low, high)


def from_nodes(
    nodes: TableNodes, predictor: GaussianProcessPredictor, chart: Chart, low: Array, high: Array
) -> PredictionTable:
    """The table over the same box, from what was computed before. Raises ValueError or IndexError if that does not fit.

    Takes a twentieth of the time of `tabulate`, and none of the matrices of the model.
    """
    sides = table_sides(predictor.scaling, chart, low, high)
    axes = [Axis(side.low, side.high, cells) for side, cells in zip(sides, nodes.cells, strict=True)]
    if np.prod([cells + 1.0 for cells in nodes.cells]) > MOST_KNOTS:
        raise ValueError(f"at most {MOST_KNOTS} knots are accepted")
    parts = [_coefficients(values, axes) for values in nodes.values]
    if predictor.correlation is not None:
        coupling = _Grid(sides, 1.0).coupling(predictor.correlation, nodes.coarse)
        matrices = [axis.coarse_to_coefficients(count) for axis, count in zip(axes, nodes.coarse, strict=True)]
        parts += [_along_all(matrices, values) for values in coupling]
    order = [3 * output + part for part in range(3) for output in range(3)] + list(range(9, len(parts)))
    coefficients = np.empty((*np.broadcast_shapes(*(part.shape for part in parts)), len(parts)), dtype=np.float32)
    for place, k in enumerate(order):  # what is constant has one box
        coefficients[..., place] = parts[k]
    # where the place does not vary, all edges share one box
    coefficients = np.repeat(coefficients, chart.boxes // len(coefficients), axis=0)
    spline = TensorSpline(axes, coefficients)
    return PredictionTable(spline, _as_slice([side.column for side in sides]), spline.knots, nodes)


def _coefficients(values: Array, axes: Sequence[Axis]) -> Array:
    """Of a spline, from values (boxes, nodes_1, ...) at the nodes."""
    counts = values.shape[1:]
    return _along_all([axis.nodes_to_coefficients(count) for axis, count in zip(axes, counts, strict=True)], values)


def _along_all(matrices: Sequence[Array], values: Array) -> Array:
    for d, matrix in enumerate(matrices):
        values = along(d + 1, matrix, values)
    return values


def on_grid(regression: Regression) -> OnGrid:
    """The posteriors of any regression, to be evaluated on grids."""
    if isinstance(regression, ConstantNoise):
        return regression
    return sparse_grid_regression(regression) if isinstance(regression, SparseVHGP) else grid_regression(regression)


def _least_variance(regression: OnGrid) -> float:
    return regression.variance if isinstance(regression, ConstantNoise) else regression.signal.least_variance


def _values(grid: _Grid, predictor: GaussianProcessPredictor, regressions: Sequence[OnGrid]) -> list[Array]:
    """At the nodes, per output: mean, variance of f and log process variance, SI units."""
    found = []
    outcome_sd, outcome_mean = predictor.scaling.outcome_sd, predictor.scaling.outcome_mean
    for k, regression in enumerate(regressions):
        mean, variance, log_process = grid.outputs(regression)
        reported = predictor.reported_sd[k]
        found += [mean * outcome_sd[k] + outcome_mean[k], variance * reported**2, log_process + 2.0 * np.log(reported)]
    return found


def _as_slice(columns: Sequence[int]) -> slice:
    """Any columns out of three, without a copy."""
    return slice(columns[0], columns[-1] + 1, columns[-1] - columns[0] if len(columns) == 2 else 1)


def _resolved(regressions: Sequence[OnGrid], correlation: Correlation | None) -> list[tuple[ArdKernel, float]]:
    """The kernels that the knots must resolve, each with the number of cells per lengthscale."""
    learnt = [regression for regression in regressions if isinstance(regression, GridRegression)]
    wanted = [(r.signal.kernel, SIGNAL.cells) for r in learnt]
    wanted += [(r.noise.kernel, NOISE.cells) for r in learnt if r.noise]
    return wanted + ([(correlation.kernel, COUPLING_CELLS)] if correlation else [])


def _cells(side: Side, resolved: Sequence[tuple[ArdKernel, float]], refinement: float) -> int:
    wanted = max((cells * side.lengthscales(kernel) for kernel, cells in resolved), default=0.0)
    return max(FEWEST_CELLS, int(np.ceil(refinement * wanted)))


@dataclass(frozen=True, eq=False)
class _Grid:
    """The nodes of a table."""

    sides: Sequence[Side]
    refinement: float

    def outputs(self, regression: OnGrid) -> list[Array]:
        """Mean and variance of f, and log process variance, at the nodes of each, (boxes, nodes_1, ...)."""
        if isinstance(regression, ConstantNoise):
            log_noise = float(np.log(regression.noise_variance))
            one = (1,) * (len(self.sides) + 1)
            return [np.full(one, value) for value in (0.0, regression.variance, log_noise)]
        mean, variance = self._moments(regression.signal, SIGNAL)
        if regression.noise is None:
            return [mean, variance, np.full((1,) * mean.ndim, regression.log_noise)]
        log_mean, spread = self._moments(regression.noise, NOISE)
        return [mean, variance, regression.log_noise + log_mean + 0.5 * spread]

    def _moments(self, posterior: GridPosterior, density: Density) -> tuple[Array, Array]:
        wanted = [density.nodes * side.lengthscales(posterior.kernel) for side in self.sides]
        counts = [int(self.refinement * (FEWEST_NODES + count)) for count in wanted]
        if (total := float(np.prod(counts, dtype=np.float64))) > MOST_NODES:
            raise TooFineError(f"{total:.0f} nodes would be needed, at most {MOST_NODES} are allowed")
        nodes = [Axis(side.low, side.high, 1).nodes(count) for side, count in zip(self.sides, counts, strict=True)]
        mean, variance = posterior.moments(self._factors(posterior.kernel, posterior.inputs, nodes))
        return _boxes_first(mean, counts), _boxes_first(variance, counts)

    def coupling(self, correlation: Correlation, cells: Sequence[int]) -> list[Array]:
        """The three numbers of a correlation at the knots of a coarse spline, (boxes, cells_1 + 1, ...) each."""
        knots = [np.linspace(side.low, side.high, count + 1) for side, count in zip(self.sides, cells, strict=True)]
        factors = self._factors(correlation.kernel, correlation.features, knots)
        sums = weighted_sums(factors, correlation.products)
        numbers = unbounded(correlations(sums.reshape(-1, sums.shape[-1]), correlation.shrinkage))
        counts = [len(knot) for knot in knots]
        return [_boxes_first(column.reshape(sums.shape[:-1]), counts) for column in numbers.T]

    def _factors(self, kernel: ArdKernel, inputs: Array, values: Sequence[Array]) -> list[Array]:
        return [side.factor(kernel, inputs, places) for side, places in zip(self.sides, values, strict=True)]


def _boxes_first(values: Array, counts: Sequence[int]) -> Array:
    """From the boxes of the place's axis one after the other, to (boxes, *counts)."""
    shape = list(chain(*((size // count, count) for size, count in zip(values.shape, counts, strict=True))))
    order = [*range(0, len(shape), 2), *range(1, len(shape), 2)]
    return values.reshape(shape).transpose(order).reshape(-1, *counts)


_LARGEST = 1.0 - 1e-12


def unbounded(correlation: Array) -> Array:
    """The three numbers (m, 3) of correlation matrices (m, 3, 3)."""
    r12, r13, r23 = correlation[:, 0, 1], correlation[:, 0, 2], correlation[:, 1, 2]
    partial = (r23 - r12 * r13) / np.sqrt((1.0 - r12**2) * (1.0 - r13**2))
    return np.arctanh(np.clip(np.column_stack([r12, r13, partial]), -_LARGEST, _LARGEST))
