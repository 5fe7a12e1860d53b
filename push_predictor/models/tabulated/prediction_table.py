# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Predictions of a learnt model tabulated over a box: their cost does not depend on the number of training rows.

The splines are those of `table_nodes` between the nodes, and all share their knots. The values at the nodes determine
the table, and take a twentieth of its memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from push_predictor.models.predictors import GaussianProcessPredictor, Moments
from push_predictor.models.push_model import DOMAIN_MARGIN, PushModel
from push_predictor.models.tabulated.grid_posterior import OnGrid
from push_predictor.models.tabulated.interpolation import Axis, TensorSpline, along_all
from push_predictor.models.tabulated.push_chart import Chart, push_chart, table_sides
from push_predictor.models.tabulated.spline import table_moments
from push_predictor.models.tabulated.table_nodes import MOST_KNOTS, Grid, TableNodes, table_nodes
from push_predictor.types import Array, BoolArray, IntArray

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
