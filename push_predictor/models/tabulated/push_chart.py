# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Where a push lies in a box of velocity, place on the outline and angle; one box for each edge that differs.

The place is a fraction of an edge of a polygon, or of the part of a smooth outline that its symmetry repeats. In these
coordinates a model's predictions are smooth; `features.push_features` is what its kernels compare. A squared
exponential kernel is a product over the sides of the box.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from push_predictor.geometry.outline import Outline
from push_predictor.models.features import EDGE_SPACING
from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.predictors import Scaling
from push_predictor.types import Array, IntArray


@dataclass(frozen=True)
class SmoothChart:
    """A smooth outline: the place goes once around the part that its rotational symmetry repeats.

    order: of the symmetry; 0 for a circle, where the place makes no difference.
    """

    order: int
    boxes = 1

    @property
    def place_columns(self) -> tuple[int, ...]:
        """The columns of the features that the place becomes."""
        return (1, 2) if self.order else ()

    def place(self, contact: Array) -> tuple[Array, IntArray]:
        """Places (n,) and boxes of contacts (n,) in [0, 1)."""
        return self.order * contact % 1.0, np.zeros(len(contact), dtype=np.intp)

    def place_features(self, places: Array) -> Array:
        """The features (boxes, m, columns) of the places (m,) of every box."""
        turn = 2.0 * np.pi * places
        return np.column_stack([np.cos(turn), np.sin(turn)])[None]


class PolygonChart:
    """A polygon: a box for each edge of the part that its symmetry repeats. See SmoothChart."""

    place_columns: tuple[int, ...] = (1,)

    def __init__(self, outline: Outline) -> None:
        self.boxes = len(outline.vertices) // outline.rotational_symmetry
        self._starts, self._per_length = outline.edge_starts, 1.0 / np.diff(outline.edge_starts)

    def place(self, contact: Array) -> tuple[Array, IntArray]:
        """See SmoothChart."""
        edge = self._starts.searchsorted(contact, side="right") - 1
        return (contact - self._starts[edge]) * self._per_length[edge], edge % self.boxes

    def place_features(self, places: Array) -> Array:
        """See SmoothChart."""
        return np.asarray(EDGE_SPACING * np.arange(self.boxes)[:, None, None] + places[:, None])


Chart: TypeAlias = SmoothChart | PolygonChart


def push_chart(outline: Outline) -> Chart:
    """The chart of an outline."""
    smooth = outline.semi_axes is not None or outline.rotational_symmetry == 0
    return SmoothChart(outline.rotational_symmetry) if smooth else PolygonChart(outline)


_PATH = 65  # points along which lengthscales are counted


def table_sides(scaling: Scaling, chart: Chart, low: Array, high: Array) -> list[Side]:
    """Those of velocity, place and angle that vary, over the box from low (3,) to high (3,)."""
    groups, sides = ((0,), chart.place_columns, (len(chart.place_columns) + 1,)), []
    for column, group in enumerate(groups):
        chosen = [k for k, feature in enumerate(group) if feature in scaling.columns]
        if chosen:
            used = [scaling.columns.index(group[k]) for k in chosen]
            sides.append(Side(column, float(low[column]), float(high[column]), used, chosen, chart, scaling))
    return sides


@dataclass(frozen=True, eq=False)
class Side:
    """One of velocity, place and angle that the model uses, from low to high.

    used: its columns among the model's features; chosen: which of its own features these are.
    """

    column: int
    low: float
    high: float
    used: list[int]
    chosen: list[int]
    chart: Chart
    scaling: Scaling

    def features(self, values: Array) -> Array:
        """Standardised features (boxes, m, len(used)) of values (m,); one box does for velocity and angle."""
        own = self.chart.place_features(values) if self.column == 1 else values[None, :, None]
        mean, sd = self.scaling.feature_mean[self.used], self.scaling.feature_sd[self.used]
        return np.asarray((own[:, :, self.chosen] - mean) / sd)

    def lengthscales(self, kernel: ArdKernel) -> float:
        """How many lengthscales of a kernel lie between low and high; around a closed outline 2 pi at least."""
        path = self._scaled(kernel, self.features(np.linspace(self.low, self.high, _PATH))[0])
        length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        return max(length, 2.0 * np.pi) if len(self.used) > 1 else length

    def factor(self, kernel: ArdKernel, inputs: Array, values: Array) -> Array:
        """The factor (boxes m, n) of a kernel's correlations between values (m,) and inputs (n, D)."""
        points = self._scaled(kernel, self.features(values)).reshape(-1, 1, len(self.used))
        inputs = self._scaled(kernel, inputs[:, self.used])
        return np.asarray(np.exp(-0.5 * ((points - inputs) ** 2).sum(axis=2)))

    def _scaled(self, kernel: ArdKernel, features: Array) -> Array:
        return np.asarray(features / np.exp(kernel.log_lengthscales[self.used]))
