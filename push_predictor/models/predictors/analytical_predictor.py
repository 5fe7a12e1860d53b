"""The analytical predictor: quasi-static mechanics with one covariance for all pushes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.analytical_scalar import scalar_analytical
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors.predictor import Moments, Shift
from push_predictor.models.predictors.without_effects import WithoutEffects
from push_predictor.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class AnalyticalPredictor(WithoutEffects):
    """The quasi-static model of Lynch et al. 1992; covariance (3, 3) of the outcomes about it."""

    physics: AnalyticalPush
    covariance: Array

    @property
    def learnt(self) -> bool:
        """See Predictor."""
        return False

    @property
    def gaussian(self) -> bool:
        """See BasePredictor."""
        return True

    @property
    def integrates(self) -> bool:
        """See Predictor."""
        return True

    def moments(self, push: Push) -> Moments:
        """See Predictor."""
        mean = self.physics.displacement(push.inputs, push.duration)
        covariance = np.broadcast_to(self.covariance, (len(mean), 3, 3)).copy()
        return Moments(mean, covariance, covariance.copy())

    def held_out_moments(self, rows: Push, block: IntArray) -> Moments:
        """See Predictor: the same as `moments`, since no function of the inputs was fitted to the rows."""
        return self.moments(rows)

    def exact_log_density(self, push: Push, outcomes: Array) -> Array | None:
        """See Predictor: None, the predictive is a Gaussian."""
        return None

    def shifted_log_density(self, push: Push, outcomes: Array, shift: Shift, scale: Array) -> Array | None:
        """See BasePredictor: None, the predictive is a Gaussian."""
        return None

    def with_independent_outputs(self) -> AnalyticalPredictor:
        """See Predictor: itself."""
        return self

    def with_scalar_mechanics(self) -> AnalyticalPredictor:
        """See Predictor."""
        return replace(self, physics=scalar_analytical(self.physics))
