# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The predictor of a slider that has hardly been pushed: mechanics under many plausible parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics, Shape
from push_predictor.models.mechanics.prior import ProcessNoise, table_of
from push_predictor.models.predictors.predictor import BasePredictor, InputLimits, Moments
from push_predictor.models.pushes import Push
from push_predictor.types import Array

ACCURACY = 0.02  # of a draw's displacement: its root mean square error is 0.04 %, and 0.1 % at the worst percent
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

    own_limits = InputLimits((0.0, FASTEST), (-STEEPEST, STEEPEST))  # all around, where the priors are meant
    absorbs = True  # a refit updates the priors of its parameters

    @property
    def mechanics(self) -> FittedMechanics:
        """See Predictor."""
        return self.fitted

    def moments(self, push: Push) -> Moments:
        """See Predictor. The covariance is that of the draws plus the process noise."""
        return Moments(*self.noise.moments(self._displacements(self._everything, push), *self._path(push)))

    def process_covariance(self, push: Push) -> Array:
        """Covariance (n, 3, 3) of the process noise."""
        return self.noise.covariance(self._displacements(self._varied, push), *self._path(push))

    @cached_property
    def _mechanics(self) -> PushMechanics:
        return replace(self.fitted.mechanics, accuracy=ACCURACY)

    @cached_property
    def _varied(self) -> Array:
        """Values (6, 28) of all parameters from which the process noise follows."""
        names = tuple(self.fitted.values)
        return table_of(names, ProcessNoise.changed(names, np.array(list(self.fitted.values.values()))))

    @cached_property
    def _everything(self) -> Array:
        """These and the draws, (6 + k, 28)."""
        return np.concatenate([self._varied, table_of(tuple(self.fitted.values), self.draws)])

    @cached_property
    def _shape(self) -> Shape:
        return self._mechanics.shape_of(self._everything)

    def _path(self, push: Push) -> tuple[Array, float]:
        """Path lengths (n,) and the length of the limit surface, m: what the noise depends on."""
        return push.inputs[:, 0] * push.duration, self._length

    @cached_property
    def _length(self) -> float:
        return self.fitted.ellipsoid.length

    def _displacements(self, values: Array, push: Push) -> Array:
        """Displacements (n, k, 3) of n pushes under k rows (k, 28) of parameters."""
        return self._mechanics.displaced(values[None], push, self._shape)
