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

"""The domain of a learnt model's training data with the model's predictions tabulated in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.models.features import push_features
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.push_model import DOMAIN_MARGIN, PushModel
from push_predictor.models.tabulated.prediction_table import PredictionTable, TableNodes, from_nodes, tabulate
from push_predictor.models.tabulated.push_chart import Chart, push_chart
from push_predictor.types import Array, BoolArray


@dataclass(frozen=True, eq=False)
class FeatureBox:
    """The box of features, from low (F,) to high (F,), of PushModel.in_domain, margin included."""

    chart: Chart
    low: Array
    high: Array

    def features(self, push: Sequence[float]) -> list[float]:
        """Features of one push, in plain numbers; see push_features."""
        velocity, contact, angle = push
        return [velocity, *map(float, self.chart.place_features(*self.chart.place_one(contact))), angle]

    def located(self, push: Sequence[float]) -> tuple[float, int] | None:
        """Place and box of one push in the domain, in plain numbers; else None."""
        velocity, contact, angle = push
        place, box = self.chart.place_one(contact)
        features = (velocity, *self.chart.place_features(place, box), angle)
        for feature, (low, high) in zip(features, self._bounds, strict=True):
            if not low <= feature <= high:
                return None
        return place, box

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
    """The domain with its table."""

    table: PredictionTable

    def predict(self, inputs: Array) -> tuple[BoolArray, Prediction | None]:
        """Which of the pushes (n, 3) lie in the domain, and the predictions if all of them do."""
        velocity, contact, angle = inputs.T
        place, box = self.chart.place(contact)
        features = np.column_stack([velocity, *self.chart.place_features(place, box), angle])
        inside = np.asarray(((features >= self.low) & (features <= self.high)).all(axis=1))
        if not inside.all():
            return inside, None
        points = np.column_stack([velocity, place, angle])
        return inside, Prediction(*self.table.moments(points, box), inside)

    def predict_one(self, push: Sequence[float]) -> Prediction | None:
        """The prediction for one push in the domain, in plain numbers, several times as fast; else None."""
        if (located := self.located(push)) is None:
            return None
        place, box = located
        numbers = np.array(self.table.moments_one((push[0], place, push[2]), box))
        covariance, process_covariance = numbers[3:].reshape(2, 1, 3, 3)
        return Prediction(numbers[None, :3], covariance, process_covariance, np.array([True]))


def tabulated_domain(model: PushModel, predictor: GaussianProcessPredictor, refinement: float = 1.0) -> TabulatedDomain:
    """The domain of a model with this predictor; refinement: of the table. Raises TooFineError."""
    box, low, high = _bounds(model)
    return TabulatedDomain(box.chart, box.low, box.high, tabulate(predictor, box.chart, low, high, refinement))


def domain_from_nodes(model: PushModel, predictor: GaussianProcessPredictor, nodes: TableNodes) -> TabulatedDomain:
    """The same from what was computed before. Raises ValueError or IndexError if that does not fit the model."""
    box, low, high = _bounds(model)
    return TabulatedDomain(box.chart, box.low, box.high, from_nodes(nodes, predictor, box.chart, low, high))


def _bounds(model: PushModel) -> tuple[FeatureBox, Array, Array]:
    """The domain, and the least and largest velocity, place and angle (3,) of the training rows."""
    inputs, box = model.training.inputs, feature_box(model)
    low, high = inputs.min(axis=0), inputs.max(axis=0)
    low[1], high[1] = box.chart.place_range(box.chart.place(inputs[:, 1])[0])
    return box, low, high
