# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The predictor of a slider that has hardly been pushed: mechanics under many plausible parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import RECORDING, PushMechanics
from push_predictor.models.mechanics.prior import ProcessNoise, displacements
from push_predictor.models.predictors.predictor import BasePredictor, InputLimits, Moments
from push_predictor.models.pushes import Push
from push_predictor.types import Array

ACCURACY = 0.01  # of a draw's displacement: moves means by less than 0.3 % of a standard deviation, in half the time
FASTEST = 0.15  # m/s: beyond it inertia, which the draws lack, changes the motion by more than the noise
STEEPEST = 1.4  # rad: in a grazing push the tip soon leaves the slider, or misses it if the outline is shifted


@dataclass(frozen=True, eq=False)
class PriorPredictor(BasePredictor):
    """The moments of the mechanics' answers under draws of their parameters, and process noise.

    fitted: the most probable parameters. draws (k, p): of these, in the order of `fitted.values`. All of them are known
    before the first push, from priors; pushes narrow the draws.
    """

    fitted: FittedMechanics
    draws: Array
    noise: ProcessNoise

    @property
    def mechanics(self) -> FittedMechanics:
        """See Predictor."""
        return self.fitted

    @property
    def own_limits(self) -> InputLimits:
        """See Predictor: pushes all around the slider, at the speeds and angles for which the priors are meant."""
        return InputLimits((0.0, FASTEST), (-STEEPEST, STEEPEST))

    @property
    def absorbs(self) -> bool:
        """See Predictor: a refit updates the priors of its parameters."""
        return True

    def moments(self, push: Push) -> Moments:
        """See Predictor. The covariance is that of the draws plus the process noise."""
        found = self._displacements(np.concatenate([self._around, self.draws]), push)
        noise, drawn = self._noise(found[:, : len(self._around)], push), found[:, len(self._around) :]
        mean = drawn.mean(axis=1)
        away = drawn - mean[:, None]
        of_parameters = np.einsum("nka,nkb->nab", away, away) / len(self.draws)
        return Moments(mean, of_parameters + noise, noise)

    def process_covariance(self, push: Push) -> Array:
        """Covariance (n, 3, 3) of the process noise."""
        return self._noise(self._displacements(self._around, push), push)

    @cached_property
    def _mechanics(self) -> PushMechanics:
        return replace(self.fitted.mechanics, accuracy=ACCURACY)

    @cached_property
    def _names(self) -> tuple[str, ...]:
        return tuple(self.fitted.values)

    @cached_property
    def _around(self) -> Array:
        """Parameters (7, p) from which the process noise follows."""
        return ProcessNoise.changed(self._names, np.array(list(self.fitted.values.values())))

    def _noise(self, around: Array, push: Push) -> Array:
        """Process covariance (n, 3, 3) from displacements (n, 7, 3) under the parameters of `_around`."""
        travel = push.inputs[:, 0] * push.duration
        return self.noise.covariance(around, travel, np.full(len(travel), self.fitted.ellipsoid.length))

    def _displacements(self, values: Array, push: Push) -> Array:
        """Displacements (n, k, 3) of n pushes under k rows (k, p) of parameters."""
        covariates = self._used(push.covariates)
        return displacements(self._mechanics, self._names, values, push.inputs, push.duration, covariates)

    def _used(self, covariates: Mapping[str, Array]) -> dict[str, Array]:
        return {RECORDING: covariates[RECORDING]} if self.fitted.mechanics.supports else {}
