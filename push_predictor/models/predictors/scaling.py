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

"""Standardisation: the units in which the regressions of a learnt predictor work."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.outline import Outline
from push_predictor.models.features import push_features
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class Scaling:
    """Mean and standard deviation of the features and of the three outcomes in the training rows.

    columns: the features that vary; the others are not used.
    """

    columns: tuple[int, ...]
    feature_mean: Array
    feature_sd: Array
    outcome_mean: Array
    outcome_sd: Array

    def features(self, outline: Outline, inputs: Array) -> Array:
        """Standardised features (n, D) of inputs (n, 3)."""
        features = push_features(outline, inputs)[:, self.columns]
        return np.asarray((features - self.feature_mean) / self.feature_sd)

    def outcomes(self, outcomes: Array) -> Array:
        """Standardised outcomes (n, 3) of outcomes (n, 3) in SI units."""
        return np.asarray((outcomes - self.outcome_mean) / self.outcome_sd)
