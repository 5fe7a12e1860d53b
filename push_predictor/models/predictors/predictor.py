# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a push model asks of the mathematics behind it, as mechanics alone do it; other bases override parts of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, NamedTuple, TypeAlias, TypeVar

import numpy as np

from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.traced_session import TracedSession
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.predictors.tails import Tails
from push_predictor.models.pushes import Push
from push_predictor.types import Array, IntArray

# For effects i < j that were estimated jointly: the covariance (coefficients of i, coefficients of j).
Cross: TypeAlias = Mapping[tuple[int, int], Array]
Self = TypeVar("Self", bound="BasePredictor")


class Moments(NamedTuple):
    """Moments of n outcomes: mean (n, 3), covariance (n, 3, 3) of an outcome, process_covariance (n, 3, 3)."""

    mean: Array
    covariance: Array
    process_covariance: Array


class Shift(NamedTuple):
    """What effects add to n predictions: mean (n, 3), and its covariance (n, 3, 3)."""

    mean: Array
    covariance: Array


class InputLimits(NamedTuple):
    """Lowest and highest velocity (m/s), smallest and largest angle (rad) of the pushes of a domain."""

    velocity: tuple[float, float]
    angle: tuple[float, float]


class BasePredictor(ABC):
    """A predictor without effects, which effects can extend; what is not overridden holds for mechanics alone."""

    # What extends it; the session on which that was traced; by name, the covariates that a push may omit, and of these
    # those in which the effects only have steps, which lie in the past.
    effects: ClassVar[tuple[Effect, ...]] = ()
    cross: ClassVar[Cross] = MappingProxyType({})
    session: ClassVar[TracedSession] = TracedSession()
    defaults: ClassVar[Mapping[str, float]] = MappingProxyType({})
    past: ClassVar[tuple[str, ...]] = ()
    # Whether it was fitted as a function of its inputs, so that its training data bound its domain; limits of the
    # pushes for which it is meant, None if its training pushes bound its domain.
    learnt: ClassVar[bool] = False
    own_limits: ClassVar[InputLimits | None] = None

    @property
    def base(self: Self) -> Self:
        """The predictor without its effects."""
        return self

    @property
    @abstractmethod
    def mechanics(self) -> FittedMechanics:
        """Mechanics whose parameters effects change: its own, or the textbook's if it has none."""

    @property
    def absorbs(self) -> bool:
        """Whether a refit learns a constant change of the mechanics, because it keeps no parameters of theirs."""
        return False

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the covariates that every push must bring."""
        return self.mechanics.needs

    @property
    def covariates(self) -> tuple[str, ...]:
        """Names of the covariates that mechanics and effects depend on, each once; some follow from the inputs."""
        return self.needs

    @property
    def tails(self) -> Tails | None:
        """Distribution of the outcomes in units of the standard deviations; None for a Gaussian or a VHGP's own."""
        return None

    def completed(self, push: Push) -> Push:
        """The pushes with those of `covariates` that follow from their inputs."""
        return push

    @abstractmethod
    def moments(self, push: Push) -> Moments:
        """Moments of the outcomes of n pushes."""

    def held_out_moments(self, rows: Push, block: IntArray) -> Moments:
        """Moments at the n training rows, each predicted without the rows of its block; hyperparameters are kept.

        block (n,): number of each row's block. Without a learnt function, training rows are predicted like others.
        """
        return self.moments(rows)

    def exact_log_density(self, push: Push, outcomes: Array) -> Array | None:
        """Log density (n, 3) of outcomes under the exact predictive, or None where that is a Gaussian."""
        return self.shifted_log_density(push, outcomes, self.shift(push), np.ones(3))

    def shifted_log_density(self, push: Push, outcomes: Array, shift: Shift, scale: Array) -> Array | None:
        """The same with a shift added and the standard deviations multiplied by scale (3,)."""
        return None

    def of_outcomes(self, learnt: Moments, push: Push) -> Moments:
        """Moments of the outcomes from those of what was learnt, which a table may contain."""
        return learnt

    def with_effects(self, moments: Moments, push: Push) -> Moments:
        """Moments of the base, from `moments` or a table, with the effects added."""
        return moments

    def shift(self, push: Push) -> Shift:
        """The sum of the effects at n pushes."""
        return Shift(np.zeros((len(push.inputs), 3)), np.zeros((len(push.inputs), 3, 3)))

    def with_base(self, base: BasePredictor) -> BasePredictor:
        """The same effects on another base."""
        return base

    def with_independent_outputs(self: Self) -> Self:
        """The same predictor without the correlation of its outputs; mechanics keep their covariance."""
        return self


@dataclass(frozen=True, eq=False)
class MechanicsPredictor(BasePredictor):
    """Mechanics, textbook's or fitted; covariance (3, 3) of the outcomes of all pushes about them."""

    fitted: FittedMechanics
    covariance: Array

    @property
    def mechanics(self) -> FittedMechanics:
        """See BasePredictor."""
        return self.fitted

    def moments(self, push: Push) -> Moments:
        """See BasePredictor."""
        mean = self.fitted.displacement(push.inputs, push.duration, push.covariates)
        of_all = np.empty((2, len(mean), 3, 3))
        of_all[:] = self.covariance
        return Moments(mean, *of_all)
