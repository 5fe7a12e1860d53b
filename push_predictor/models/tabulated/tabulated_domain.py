# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A learnt model's predictions tabulated: over all contacts, all angles and up to twice its speeds, if it can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from push_predictor.models.predictors import GaussianProcessPredictor, Moments
from push_predictor.models.push_model import DOMAIN_MARGIN, PushModel
from push_predictor.models.tabulated.prediction_table import OnGrid, PredictionTable, TableNodes, from_nodes, tabulate
from push_predictor.models.tabulated.push_chart import Chart, push_chart
from push_predictor.types import Array, BoolArray, IntArray

FASTEST = 2.0  # largest training speeds, up to which a wide table reaches


@dataclass(frozen=True, eq=False)
class TabulatedDomain:
    """A table of a box that contains the domain: from least to most (3,) of velocity, place and angle.

    limited: whether beyond the table's speeds the predictions are those of the nearest one.
    """

    chart: Chart
    table: PredictionTable
    least: Array
    most: Array
    limited: bool

    def covered(self, inputs: Array) -> BoolArray:
        """Which of the pushes (n, 3) the table contains, (n,)."""
        return self._inside(self._points(inputs)[0])

    def moments(self, inputs: Array) -> Moments | None:
        """The moments of pushes (n, 3), None unless the table contains all of them."""
        points, box = self._points(inputs)
        return self.table.moments(points, box) if self._inside(points).all() else None

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


def wide_box(model: PushModel) -> tuple[Array, Array]:
    """Least and most velocity, place and angle (3,) of a table for all pushes.

    Up to FASTEST times the training's speeds, unless the predictions beyond these are those of the nearest one.
    """
    fastest = float(model.training.inputs[:, 0].max())
    slow, fast = _speeds(model) or (0.0, FASTEST * fastest)
    return np.array([slow, 0.0, -0.5 * pi]), np.array([fast, 1.0, 0.5 * pi])


def _speeds(model: PushModel) -> tuple[float, float] | None:
    predictor = model.predictor.base
    return predictor.scaling.speeds if isinstance(predictor, GaussianProcessPredictor) else None


def narrow_box(model: PushModel) -> tuple[Array, Array]:
    """The same of a table of the domain alone."""
    inputs, chart = model.training.inputs, push_chart(model.rig.outline)
    low, high = inputs.min(axis=0), inputs.max(axis=0)
    low[1], high[1] = chart.place_range(chart.place(inputs[:, 1])[0])
    return low, high


def tabulated_domain(
    model: PushModel,
    predictor: GaussianProcessPredictor,
    posteriors: Sequence[OnGrid],
    ends: tuple[Array, Array],
    refinement: float = 1.0,
) -> TabulatedDomain:
    """The domain of a model with this predictor, tabulated between these ends.

    posteriors: its regressions, see prediction_table.on_grid; refinement: of the table. Raises TooFineError.
    """
    chart = push_chart(model.rig.outline)
    table = tabulate(predictor, posteriors, chart, *ends, refinement)
    return TabulatedDomain(chart, table, *ends, limited=_speeds(model) is not None)


def domain_from_nodes(
    model: PushModel, predictor: GaussianProcessPredictor, ends: tuple[Array, Array], nodes: TableNodes
) -> TabulatedDomain:
    """The same from what was computed before. Raises ValueError or IndexError if that does not fit the model."""
    chart = push_chart(model.rig.outline)
    return TabulatedDomain(chart, from_nodes(nodes, predictor, chart, *ends), *ends, limited=_speeds(model) is not None)
