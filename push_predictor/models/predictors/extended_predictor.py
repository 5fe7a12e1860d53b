# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A base predictor extended by effects that it lacks."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import JointEffects, covariance_of, joint
from push_predictor.models.effects.traced_session import TracedSession
from push_predictor.models.gaussian_process.prediction import Remembered
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.predictors.predictor import BasePredictor, Cross, InputLimits, Moments, Shift
from push_predictor.models.predictors.tails import Tails
from push_predictor.models.pushes import Push
from push_predictor.recordings.table import INPUTS
from push_predictor.types import Array, IntArray

SIDE, HEADING = "edge", "slider_heading"
GIVEN_BY_INPUTS = (*INPUTS, SIDE)  # covariates that follow from the push, so that no request needs to bring them


@dataclass(frozen=True, eq=False)
class ExtendedPredictor:
    """A base with effects: each shifts the mean and adds its own uncertainty to the covariance.

    scale (3,): factor on the base's standard deviations of dx, dy, dtheta, estimated with the effects in. cross: see
    Cross; pairs that it lacks are independent. Without it, two effects with correlated covariates would seem far
    less certain than their sum is. session: the one that the effects were traced on.
    """

    base: BasePredictor
    effects: tuple[Effect, ...]
    scale: Array
    cross: Cross = field(default_factory=dict)
    session: TracedSession = field(default_factory=TracedSession)
    _known: Remembered[Shift] = field(default_factory=Remembered, init=False, repr=False)

    @property
    def mechanics(self) -> FittedMechanics:
        """See BasePredictor."""
        return self.base.mechanics

    @property
    def learnt(self) -> bool:
        """See BasePredictor."""
        return self.base.learnt

    @property
    def tails(self) -> Tails | None:
        """See BasePredictor: those of the base."""
        return self.base.tails

    @property
    def absorbs(self) -> bool:
        """See BasePredictor."""
        return self.base.absorbs

    @cached_property
    def covariates(self) -> tuple[str, ...]:
        """See BasePredictor."""
        of_effects = (name for effect in self.effects for name in effect.needs)
        return tuple(dict.fromkeys((*self.base.covariates, *of_effects)))

    @cached_property
    def needs(self) -> tuple[str, ...]:
        """See BasePredictor."""
        return tuple(name for name in self.covariates if name not in (*GIVEN_BY_INPUTS, *self.defaults))

    @cached_property
    def defaults(self) -> dict[str, float]:
        """See BasePredictor."""
        return {name: self.session.now[name] for name in self.covariates if name in self.session.now}

    @cached_property
    def past(self) -> tuple[str, ...]:
        """See BasePredictor."""
        growing = {name for effect in self.effects if effect.basis.name != "step" for name in effect.needs}
        return tuple(name for name in self.defaults if name not in growing)

    @property
    def own_limits(self) -> InputLimits | None:
        """See BasePredictor."""
        return self.base.own_limits

    def completed(self, push: Push) -> Push:
        """See BasePredictor."""
        if not self._of_inputs and self.defaults.keys() <= push.covariates.keys():
            return push
        given = dict(zip(INPUTS, push.inputs.T, strict=True))
        if SIDE in self._of_inputs:
            given[SIDE] = self.mechanics.outline.edge(push.inputs[:, 1])[0].astype(np.float64)
        own = {name: given[name] for name in self._of_inputs}
        now = {name: np.full(len(push.inputs), value) for name, value in self.defaults.items()}
        return replace(push, covariates={**now, **push.covariates, **own})

    @cached_property
    def _of_inputs(self) -> tuple[str, ...]:
        return tuple(name for name in self.covariates if name in GIVEN_BY_INPUTS)

    def moments(self, push: Push) -> Moments:
        """See BasePredictor."""
        return self.with_effects(self.base.moments(push), push)

    def held_out_moments(self, rows: Push, block: IntArray) -> Moments:
        """See BasePredictor; the effects are those estimated from all rows."""
        return self.with_effects(self.base.held_out_moments(rows, block), rows)

    def with_effects(self, moments: Moments, push: Push) -> Moments:
        """See BasePredictor."""
        mean, total, process = moments
        shift, uncertainty = self.shift(push)
        return Moments(mean + shift, total * self._factor + uncertainty, process * self._factor)

    @cached_property
    def _factor(self) -> Array:
        """Of the base's covariances, (3, 3)."""
        return np.outer(self.scale, self.scale)

    def shift(self, push: Push) -> Shift:
        """See BasePredictor."""
        if not self.effects:
            return Shift(np.zeros((len(push.inputs), 3)), np.zeros((len(push.inputs), 3, 3)))
        push = self.completed(push)
        # Mechanics with a grain take the slider's heading, where it is given, in place of the push heading they need.
        used = [push.covariates[name] for name in (*self.covariates, HEADING) if name in push.covariates]
        return self._known.of(lambda: self._shift(push), push.inputs, push.duration, *used)

    def _shift(self, push: Push) -> Shift:
        if len(self._acting.effects) < len(self.effects):  # an effect without a mechanism
            together = joint(self.mechanics, self.effects, push)
            design = np.concatenate(together.designs, axis=2).transpose(0, 2, 1)
            return Shift(together.shift, design.transpose(0, 2, 1) @ self._covariance @ design)
        shift, slopes, columns = self._acting.shifted(self.mechanics, push)
        return Shift(shift, self._acting.uncertainty(columns, slopes, self._covariance))

    @cached_property
    def _acting(self) -> JointEffects:
        return JointEffects.of(self.effects)

    @cached_property
    def _covariance(self) -> Array:
        """Of the coefficients of all effects."""
        return covariance_of(self.effects, self.cross)

    def exact_log_density(self, push: Push, outcomes: Array) -> Array | None:
        """See BasePredictor."""
        return self.base.shifted_log_density(push, outcomes, self.shift(push), self.scale)

    def with_base(self, base: BasePredictor) -> ExtendedPredictor:
        """See BasePredictor."""
        return replace(self, base=base)

    def with_independent_outputs(self) -> ExtendedPredictor:
        """See BasePredictor."""
        return replace(self, base=self.base.with_independent_outputs())


Predictor: TypeAlias = BasePredictor | ExtendedPredictor
