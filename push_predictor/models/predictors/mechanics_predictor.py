"""The predictor of fitted mechanics: the exact forward model with one covariance for all pushes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.scalar.mechanics import scalar_mechanics
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors.predictor import Moments, Shift
from push_predictor.models.predictors.without_effects import WithoutEffects
from push_predictor.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class MechanicsPredictor(WithoutEffects):
    """Mechanics with fitted parameters; covariance (3, 3) of the outcomes about it."""

    fitted: FittedMechanics
    covariance: Array

    @cached_property
    def physics(self) -> AnalyticalPush:
        """See Predictor: the nearest ellipsoidal model."""
        return self.fitted.ellipsoid()

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

    @property
    def needs(self) -> tuple[str, ...]:
        """See Predictor."""
        return self.fitted.needs

    @property
    def covariates(self) -> tuple[str, ...]:
        """See Predictor: those that the parameters depend on."""
        return self.fitted.needs

    def moments(self, push: Push) -> Moments:
        """See Predictor."""
        mean = self.fitted.displacement(push.inputs, push.duration, push.covariates)
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

    def with_independent_outputs(self) -> MechanicsPredictor:
        """See Predictor: itself."""
        return self

    def with_scalar_mechanics(self) -> MechanicsPredictor:
        """See Predictor."""
        return replace(self, fitted=scalar_mechanics(self.fitted))
