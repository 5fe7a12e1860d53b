"""The predictor of a slider that has hardly been pushed: mechanics under many plausible parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from push_predictor.models.mechanics.fitted import RECORDING
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameter_draws import displacements
from push_predictor.models.mechanics.process_noise import ProcessNoise
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors.of_mechanics import OfFittedMechanics
from push_predictor.models.predictors.predictor import Moments
from push_predictor.types import Array, BoolArray

ACCURACY = 0.01  # of a draw's displacement: moves means by less than 0.3 % of a standard deviation, in half the time
FASTEST = 0.15  # m/s: beyond it inertia, which the draws lack, changes the motion by more than the noise
STEEPEST = 1.4  # rad: in a grazing push the tip soon leaves the slider, or misses it if the outline is shifted


@dataclass(frozen=True, eq=False)
class PriorPredictor(OfFittedMechanics):
    """The moments of the mechanics' answers under draws of their parameters, and process noise.

    fitted: the most probable parameters. draws (k, p): of these, in the order of `fitted.values`. All of them are known
    before the first push, from priors; pushes narrow the draws.
    """

    draws: Array
    noise: ProcessNoise

    def in_own_domain(self, inputs: Array) -> BoolArray:
        """See Predictor: pushes all around the slider, at the speeds and angles for which the priors are meant."""
        return np.asarray((inputs[:, 0] <= FASTEST) & (np.abs(inputs[:, 2]) <= STEEPEST))

    @property
    def absorbs(self) -> bool:
        """See Predictor: a refit updates the priors of its parameters."""
        return True

    def moments(self, push: Push) -> Moments:
        """See Predictor. The covariance is that of the draws plus the process noise."""
        rows = np.concatenate([self._around, self.draws])
        covariates = self._used(push.covariates)
        found = displacements(self._mechanics, self._names, rows, push.inputs, push.duration, covariates)
        around, drawn = found[:, : len(self._around)], found[:, len(self._around) :]
        travel = push.inputs[:, 0] * push.duration
        noise = self.noise.covariance(around, travel, np.full(len(travel), self.physics.support.length))
        mean = drawn.mean(axis=1)
        away = drawn - mean[:, None]
        of_parameters = np.einsum("nka,nkb->nab", away, away) / len(self.draws)
        return Moments(mean, of_parameters + noise, noise)

    def with_scalar_mechanics(self) -> PriorPredictor:
        """See Predictor: itself."""
        return self

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

    def _used(self, covariates: Mapping[str, Array]) -> dict[str, Array]:
        return {RECORDING: covariates[RECORDING]} if self.fitted.mechanics.supports else {}
