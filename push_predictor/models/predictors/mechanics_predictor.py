# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The predictor of mechanics, textbook's or fitted: the forward model with one covariance for all pushes."""

from __future__ import annotations

from dataclasses import dataclass

from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.predictors.predictor import BasePredictor, Moments
from push_predictor.models.pushes import Push
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class MechanicsPredictor(BasePredictor):
    """Mechanics with their parameters; covariance (3, 3) of the outcomes about it."""

    fitted: FittedMechanics
    covariance: Array

    @property
    def mechanics(self) -> FittedMechanics:
        """See Predictor."""
        return self.fitted

    def moments(self, push: Push) -> Moments:
        """See Predictor."""
        mean = self.fitted.displacement(push.inputs, push.duration, push.covariates)
        of_all = self.covariance[None].repeat(len(mean), axis=0)
        return Moments(mean, of_all, of_all.copy())
