"""The analytical predictor: quasi-static mechanics with one covariance for all pushes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.analytical_scalar import scalar_analytical
from push_predictor.models.mechanics.fitted import FittedMechanics, mechanics_of
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors.of_mechanics import OfMechanics
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
        covariance = np.broadcast_to(self.covariance, (len(mean), 3, 3)).copy()
        return Moments(mean, covariance, covariance.copy())

    def with_scalar_mechanics(self) -> AnalyticalPredictor:
        """See Predictor."""
        return replace(self, physics=scalar_analytical(self.physics))
