# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A learnt model's predictions tabulated: over all contacts, all angles and up to twice its speeds, if it can be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from push_predictor.models.features import push_features
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.push_model import DOMAIN_MARGIN, PushModel
from push_predictor.models.tabulated.prediction_table import OnGrid, PredictionTable, TableNodes, from_nodes, tabulate
from push_predictor.models.tabulated.push_chart import Chart, Whole, push_chart
from push_predictor.types import Array, BoolArray

FASTEST = 2.0  # largest training speeds, up to which a wide table reaches


@dataclass(frozen=True, eq=False)
class FeatureBox:
    """The box of features, from low (F,) to high (F,), of PushModel.in_domain, margin included."""

    chart: Chart
    low: Array
    high: Array

    def contains(self, push: Sequence[float]) -> bool:
        """Whether one push lies in the domain, in plain numbers."""
        velocity, contact, angle = push
        return self._contains(velocity, *self.chart.place_one(contact), angle)

    def _contains(self, velocity: float, place: float, box: Whole, angle: float) -> bool:
        features = (velocity, *self.chart.place_features(place, box), angle)
        return all(low <= feature <= high for feature, (low, high) in zip(features, self._bounds, strict=True))

    @cached_property
    def _bounds(self) -> list[tuple[float, float]]:
        return list(zip(self.low.tolist(), self.high.tolist(), strict=True))


def feature_box(model: PushModel) -> FeatureBox:
    """The box of a model's training rows."""
    features = push_features(model.rig.outline, model.training.inputs)
    least, most = features.min(axis=0), features.max(axis=0)
    margin = DOMAIN_MARGIN + 1e-6 * np.abs(most)
    return FeatureBox(push_chart(model.rig.outline), least - margin, most + margin)


@dataclass(frozen=True, eq=False)
class TabulatedDomain(FeatureBox):
    """The domain with a table of a box that contains it: from least to most (3,) of velocity, place and angle.

    limited: whether beyond the table's speeds the predictions are those of the nearest one.
    """

    table: PredictionTable
    least: Array
    most: Array
    limited: bool = False

    def covered(self, inputs: Array) -> BoolArray:
        """Which of the pushes (n, 3) the table contains, (n,)."""
        velocity, place = self._speed(inputs[:, 0]), self.chart.place(inputs[:, 1])[0]
        return self._covered(np.column_stack([velocity, place, inputs[:, 2]]))

    def predict(self, inputs: Array) -> tuple[BoolArray, Prediction | None]:
        """Which of the pushes (n, 3) the table contains, and the predictions if it contains all of them."""
        velocity, contact, angle = inputs.T
        place, box = self.chart.place(contact)
        points = np.column_stack([self._speed(velocity), place, angle])
        covered = self._covered(points)
        if not covered.all():
            return covered, None
        features = np.column_stack([velocity, *self.chart.place_features(place, box), angle])
        inside = np.asarray(((features >= self.low) & (features <= self.high)).all(axis=1))
        return covered, Prediction(*self.table.moments(points, box), inside)

    def predict_one(self, push: Sequence[float]) -> Prediction | None:
        """The prediction for one push, in plain numbers, several times as fast; None if the table lacks it."""
        velocity, contact, angle = push
        place, box = self.chart.place_one(contact)
        (slow, start, left), (fast, end, right) = self._ends
        speed = min(max(velocity, slow), fast) if self.limited else velocity
        if not (slow <= speed <= fast and start <= place <= end and left <= angle <= right):
            return None
        numbers = np.array(self.table.moments_one((speed, place, angle), box))
        covariance, process_covariance = numbers[3:].reshape(2, 1, 3, 3)
        inside = np.array([self._contains(velocity, place, box, angle)])
        return Prediction(numbers[None, :3], covariance, process_covariance, inside)

    def _speed(self, velocity: Array) -> Array:
        """Velocities (n,) at which the table is asked."""
        return np.clip(velocity, self._ends[0][0], self._ends[1][0]) if self.limited else velocity

    def _covered(self, points: Array) -> BoolArray:
        low, high = self._ends
        return np.asarray(((points >= low) & (points <= high)).all(axis=1))

    @cached_property
    def _ends(self) -> tuple[list[float], list[float]]:
        margin = DOMAIN_MARGIN + 1e-6 * np.abs(self.most)
        return (self.least - margin).tolist(), (self.most + margin).tolist()


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
    box = feature_box(model)
    table = tabulate(predictor, posteriors, box.chart, *ends, refinement)
    return TabulatedDomain(box.chart, box.low, box.high, table, *ends, _speeds(model) is not None)


def domain_from_nodes(
    model: PushModel, predictor: GaussianProcessPredictor, ends: tuple[Array, Array], nodes: TableNodes
) -> TabulatedDomain:
    """The same from what was computed before. Raises ValueError or IndexError if that does not fit the model."""
    box = feature_box(model)
    table = from_nodes(nodes, predictor, box.chart, *ends)
    return TabulatedDomain(box.chart, box.low, box.high, table, *ends, _speeds(model) is not None)
