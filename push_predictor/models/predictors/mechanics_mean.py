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

"""The mean function of an informed predictor: fitted mechanics, about which residuals are learnt.

Residuals are taken per path length: as a model knows them from pushes of one speed, those of a push of twice the speed
are twice as large.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.predictors.predictor import Moments
from push_predictor.models.push import Push
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class MechanicsMean:
    """Fitted mechanics and the path length travel (m) at which a residual counts as it is."""

    fitted: FittedMechanics
    travel: float

    def displacement(self, push: Push) -> Array:
        """Displacement (n, 3) of the mechanics."""
        return self.fitted.displacement(push.inputs, push.duration, push.covariates)

    def size(self, push: Push) -> Array:
        """Path lengths (n,) over `travel`: factor on mean and standard deviation of the residual."""
        return np.asarray(push.inputs[:, 0] * push.duration / self.travel)

    def residuals(self, push: Push, outcomes: Array) -> Array:
        """What the outcomes (n, 3) are more than the displacement, at a path of `travel`."""
        return np.asarray((outcomes - self.displacement(push)) / self.size(push)[:, None])

    def outcomes(self, push: Push, residuals: Moments) -> Moments:
        """Moments of the outcomes from those of the residuals."""
        mean, covariance, process_covariance = self.scaled(push, residuals)
        return Moments(mean + self.displacement(push), covariance, process_covariance)

    def scaled(self, push: Push, residuals: Moments) -> Moments:
        """Moments of the outcomes about the displacement from those of the residuals."""
        size = self.size(push)
        square = (size * size)[:, None, None]
        return Moments(
            residuals.mean * size[:, None], residuals.covariance * square, residuals.process_covariance * square
        )
