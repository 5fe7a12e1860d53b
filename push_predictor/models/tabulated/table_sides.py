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

"""The sides of the box that a table covers: those of velocity, place and angle that a learnt model uses.

A squared exponential kernel is a product over them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.predictors import Scaling
from push_predictor.models.tabulated.push_chart import Chart
from push_predictor.types import Array

_PATH = 65  # points along which lengthscales are counted


def table_sides(scaling: Scaling, chart: Chart, low: Array, high: Array) -> list[Side]:
    """Those of velocity, place and angle that vary, over the box from low (3,) to high (3,)."""
    groups = ((0,), chart.place_columns, (len(chart.place_columns) + 1,))
    sides = []
    for column, (group, features) in enumerate(zip(groups, (_itself, _places(chart), _itself), strict=True)):
        chosen = [k for k, feature in enumerate(group) if feature in scaling.columns]
        if chosen:
            used = [scaling.columns.index(group[k]) for k in chosen]
            standardised = _standardised(features, chosen, scaling.feature_mean[used], scaling.feature_sd[used])
            sides.append(Side(column, float(low[column]), float(high[column]), used, standardised))
    return sides


@dataclass(frozen=True, eq=False)
class Side:
    """One of velocity, place and angle that the model uses: `used` are its columns among the model's features."""

    column: int
    low: float
    high: float
    used: list[int]
    features: Callable[[Array], Array]  # values (m,) -> standardised features (boxes, m, len(used))

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


def _itself(values: Array) -> Array:
    return values[None, :, None]


def _places(chart: Chart) -> Callable[[Array], Array]:
    """Features (boxes, m, columns) of the places (m,) of every box."""
    return lambda places: np.stack(
        [np.column_stack(chart.place_features(places, np.full(len(places), k))) for k in range(chart.boxes)]
    )


def _standardised(
    features: Callable[[Array], Array], chosen: list[int], mean: Array, sd: Array
) -> Callable[[Array], Array]:
    return lambda values: (features(values)[:, :, chosen] - mean) / sd
