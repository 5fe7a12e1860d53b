# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Predictions of a learnt model tabulated over a box: their cost does not depend on the number of training rows.

What is computed of the model are values at nodes that are as dense as its lengthscales need. Per output: the mean and
the variance of f, and the log process variance, which is what is smooth: the variance of f has narrow dips at the
training pushes, of quadratic shape. The nodes are Chebyshev's. A correlation of the outputs is evaluated at coarser
knots of its own, as the three numbers of `unbounded`. The values at the nodes determine the table, and take a twentieth
of its memory. The splines between them all share their knots.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from math import pi

import numpy as np

from push_predictor.errors import PushPredictorError
from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.regression import ConstantNoise
from push_predictor.models.predictors import GaussianProcessPredictor, Moments
from push_predictor.models.predictors.correlation import Correlation, correlations
from push_predictor.models.push_model import DOMAIN_MARGIN, PushModel
from push_predictor.models.tabulated.grid_posterior import GridPosterior, GridRegression, OnGrid, weighted_sums
from push_predictor.models.tabulated.interpolation import Axis, TensorSpline, along_all
from push_predictor.models.tabulated.push_chart import Chart, Side, push_chart, table_sides
from push_predictor.models.tabulated.spline import table_moments
from push_predictor.types import Array, BoolArray, IntArray

MOST_KNOTS = 2_000_000  # 96 MB
MOST_NODES = 150_000  # of one posterior and edge: some seconds
FEWEST_NODES = 10
FEWEST_CELLS = 16


@dataclass(frozen=True)
class Density:
    """Nodes and cells per lengthscale."""

    nodes: float
    cells: float


# f must be accurate to a small fraction of the noise, the noise to one of itself
SIGNAL = Density(nodes=4.0, cells=12.0)
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


def table_nodes(
    predictor: GaussianProcessPredictor,
    posteriors: Sequence[OnGrid],
    boxes: int,
    sides: Sequence[Side],
    refinement: float,
) -> TableNodes:
    """The nodes of a table of some boxes with these sides. Raises TooFineError."""
    resolved, correlation = _resolved(posteriors, predictor.correlation), predictor.correlation
    cells = [_cells(side, resolved, refinement) for side in sides]
    knots = boxes * int(np.prod([count + 1.0 for count in cells]))
    if knots > MOST_KNOTS:
        raise TooFineError(f"{knots} knots would be needed, at most {MOST_KNOTS} are allowed")
    coupled = [(correlation.known.kernel, COUPLING_CELLS)] if correlation else []
    coarse = [_cells(side, coupled, refinement) for side in sides] if correlation else []
    least = predictor.reported_sd**2 * [_least_variance(regression) for regression in posteriors]
    return TableNodes(cells, coarse, least.tolist(), _values(Grid(sides, refinement), predictor, posteriors))


def _least_variance(regression: OnGrid) -> float:
    return regression.variance if isinstance(regression, ConstantNoise) else regression.signal.least_variance


def _values(grid: Grid, predictor: GaussianProcessPredictor, regressions: Sequence[OnGrid]) -> list[Array]:
    """At the nodes, per output: mean, variance of f and log process variance, SI units."""
    found = []
    outcome_sd, outcome_mean = predictor.scaling.outcome_sd, predictor.scaling.outcome_mean
    for k, regression in enumerate(regressions):
        mean, variance, log_process = grid.outputs(regression)
        reported = predictor.reported_sd[k]
        found += [mean * outcome_sd[k] + outcome_mean[k], variance * reported**2, log_process + 2.0 * np.log(reported)]
    return found


def _resolved(regressions: Sequence[OnGrid], correlation: Correlation | None) -> list[tuple[ArdKernel, float]]:
    """The kernels that the knots must resolve, each with the number of cells per lengthscale."""
    learnt = [regression for regression in regressions if isinstance(regression, GridRegression)]
    wanted = [(r.signal.kernel, SIGNAL.cells) for r in learnt]
    wanted += [(r.noise.kernel, NOISE.cells) for r in learnt if r.noise]
    return wanted + ([(correlation.known.kernel, COUPLING_CELLS)] if correlation else [])


def _cells(side: Side, resolved: Sequence[tuple[ArdKernel, float]], refinement: float) -> int:
    wanted = max((cells * side.lengthscales(kernel) for kernel, cells in resolved), default=0.0)
    return max(FEWEST_CELLS, int(np.ceil(refinement * wanted)))


@dataclass(frozen=True, eq=False)
class Grid:
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
        factors = self._factors(correlation.known.kernel, correlation.features, knots)
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


FASTEST = 2.0  # largest training speeds, up to which a wide table reaches


@dataclass(frozen=True, eq=False)
class PredictionTable:
    """A table of a box from least to most (3,) of velocity, place and angle; see push_chart.

    columns: which of them the splines depend on. nodes: what the splines were computed from. limited: whether beyond
    the table's speeds the predictions are those of the nearest one.
    """

    chart: Chart
    spline: TensorSpline
    columns: slice
    nodes: TableNodes
    least: Array
    most: Array
    limited: bool

    def covered(self, inputs: Array) -> BoolArray:
        """Which of the pushes (n, 3) the table contains, (n,)."""
        return self._inside(self._points(inputs)[0])

    def moments(self, inputs: Array) -> Moments | None:
        """The moments of pushes (n, 3) in SI units, None unless the table contains all of them."""
        points, box = self._points(inputs)
        if not self._inside(points).all():
            return None
        values = self.spline(np.ascontiguousarray(points[:, self.columns]), box)
        covariance, process = np.empty((2, len(points), 3, 3))
        table_moments(values, self._least_variances, covariance, process)
        return Moments(values[:, :3], covariance, process)

    @cached_property
    def _least_variances(self) -> Array:
        return np.array(self.nodes.least, dtype=np.float64)

    def _points(self, inputs: Array) -> tuple[Array, IntArray]:
        """Velocity, place and angle (n, 3), and boxes (n,)."""
        place, box = self.chart.place(inputs[:, 1])
        points = inputs.copy()
        points[:, 1] = place
        if self.limited:
            (slowest, *_), (fastest, *_) = self._ends
            points[:, 0] = np.minimum(np.maximum(points[:, 0], slowest), fastest)
        return points, box

    def _inside(self, points: Array) -> BoolArray:
        low, high = self._ends
        return np.asarray(((points >= low) & (points <= high)).all(axis=1))

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        margin = DOMAIN_MARGIN + 1e-6 * np.abs(self.most)
        return self.least - margin, self.most + margin


def wide_box(model: PushModel, predictor: GaussianProcessPredictor) -> tuple[Array, Array]:
    """Least and most velocity, place and angle (3,) of a table for all pushes of a model with this base.

    Up to FASTEST times the training's speeds, unless the predictions beyond these are those of the nearest one.
    """
    slow, fast = predictor.scaling.speeds or (0.0, FASTEST * float(model.training.inputs[:, 0].max()))
    return np.array([slow, 0.0, -0.5 * pi]), np.array([fast, 1.0, 0.5 * pi])


def narrow_box(model: PushModel) -> tuple[Array, Array]:
    """The same of a table of all places at the speeds and angles of the training alone."""
    low, high = model.training.inputs.min(axis=0), model.training.inputs.max(axis=0)
    low[1], high[1] = 0.0, 1.0
    return low, high


def prediction_table(
    predictor: GaussianProcessPredictor,
    posteriors: Sequence[OnGrid],
    ends: tuple[Array, Array],
    refinement: float = 1.0,
) -> PredictionTable:
    """The table of a predictor of what was learnt, between these ends.

    posteriors: of its regressions, see on_grid. refinement: factor on the usual number of nodes and knots along each
    axis. Raises TooFineError.
    """
    chart = push_chart(predictor.rig.outline)
    sides = table_sides(predictor.scaling, chart, *ends)
    return table_from_nodes(table_nodes(predictor, posteriors, chart.boxes, sides, refinement), predictor, ends)


def table_from_nodes(
    nodes: TableNodes, predictor: GaussianProcessPredictor, ends: tuple[Array, Array]
) -> PredictionTable:
    """The same from what was computed before. Raises ValueError or IndexError if that does not fit.

    Takes a twentieth of the time, and none of the matrices of the model.
    """
    chart = push_chart(predictor.rig.outline)
    sides = table_sides(predictor.scaling, chart, *ends)
    axes = [Axis(side.low, side.high, cells) for side, cells in zip(sides, nodes.cells, strict=True)]
    if np.prod([cells + 1.0 for cells in nodes.cells]) > MOST_KNOTS:
        raise ValueError(f"at most {MOST_KNOTS} knots are accepted")
    parts = [_coefficients(values, axes) for values in nodes.values]
    if predictor.correlation is not None:
        coupling = Grid(sides, 1.0).coupling(predictor.correlation, nodes.coarse)
        matrices = [axis.coarse_to_coefficients(count) for axis, count in zip(axes, nodes.coarse, strict=True)]
        parts += [along_all(matrices, values) for values in coupling]
    order = [3 * output + part for part in range(3) for output in range(3)] + list(range(9, len(parts)))
    coefficients = np.empty((*np.broadcast_shapes(*(part.shape for part in parts)), len(parts)), dtype=np.float32)
    for place, k in enumerate(order):  # what is constant has one box
        coefficients[..., place] = parts[k]
    # where the place does not vary, all edges share one box
    coefficients = np.repeat(coefficients, chart.boxes // len(coefficients), axis=0)
    columns, limited = _as_slice([side.column for side in sides]), predictor.scaling.speeds is not None
    return PredictionTable(chart, TensorSpline(axes, coefficients), columns, nodes, *ends, limited)


def _coefficients(values: Array, axes: Sequence[Axis]) -> Array:
    """Of a spline, from values (boxes, nodes_1, ...) at the nodes."""
    counts = values.shape[1:]
    return along_all([axis.nodes_to_coefficients(count) for axis, count in zip(axes, counts, strict=True)], values)


def _as_slice(columns: Sequence[int]) -> slice:
    """Any columns out of three, without a copy."""
    return slice(columns[0], columns[-1] + 1, columns[-1] - columns[0] if len(columns) == 2 else 1)
