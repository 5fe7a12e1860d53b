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

"""The analytical predictor: quasi-static mechanics with one covariance for all pushes."""

from __future__ import annotations

from dataclasses import dataclass, replace

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.analytical_scalar import scalar_analytical
from push_predictor.models.mechanics.fitted import FittedMechanics, mechanics_of
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors.of_mechanics import OfMechanics, with_one_covariance
from push_predictor.models.predictors.predictor import Moments
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class AnalyticalPredictor(OfMechanics):
    """The quasi-static model of Lynch et al. 1992; covariance (3, 3) of the outcomes about it."""

    physics: AnalyticalPush
    covariance: Array

    @property
    def mechanics(self) -> FittedMechanics:
        """See Predictor."""
        return mechanics_of(self.physics)

    def moments(self, push: Push) -> Moments:
        """See Predictor."""
        mean = self.physics.displacement(push.inputs, push.duration)
        return with_one_covariance(mean, self.covariance)

    def with_scalar_mechanics(self) -> AnalyticalPredictor:
        """See Predictor."""
        return replace(self, physics=scalar_analytical(self.physics))
