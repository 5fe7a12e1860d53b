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

"""The part of the predictor protocol that predictors share whose mean is mechanics alone."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TypeVar

from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.predictors.predictor import Moments, Shift
from push_predictor.models.predictors.tails import Tails
from push_predictor.models.predictors.without_effects import WithoutEffects
from push_predictor.models.push import Push
from push_predictor.types import Array, IntArray

Self = TypeVar("Self")


@dataclass(frozen=True, eq=False)
class OfMechanics(WithoutEffects, ABC):
    """A predictor without a learnt function of its inputs, whose predictive is taken for a Gaussian."""

    fitted: FittedMechanics

    @property
    def mechanics(self) -> FittedMechanics:
        """See Predictor."""
        return self.fitted

    @property
    def needs(self) -> tuple[str, ...]:
        """See Predictor."""
        return self.fitted.needs

    @property
    def covariates(self) -> tuple[str, ...]:
        """See Predictor: those that the parameters depend on."""
        return self.fitted.needs

    @property
    def learnt(self) -> bool:
        """See Predictor."""
        return False

    @property
    def absorbs(self) -> bool:
        """See Predictor: its parameters are kept."""
        return False

    @property
    def gaussian(self) -> bool:
        """See BasePredictor."""
        return True

    @property
    def tails(self) -> Tails | None:
        """See Predictor: None."""
        return None

    @property
    def integrates(self) -> bool:
        """See Predictor."""
        return True

    @abstractmethod
    def moments(self, push: Push) -> Moments:
        """See Predictor."""

    def held_out_moments(self, rows: Push, block: IntArray) -> Moments:
        """See Predictor: the same as `moments`, since no function of the inputs was fitted to the rows."""
        return self.moments(rows)

    def exact_log_density(self, push: Push, outcomes: Array) -> Array | None:
        """See Predictor: None, the predictive is taken for a Gaussian."""
        return None

    def shifted_log_density(self, push: Push, outcomes: Array, shift: Shift, scale: Array) -> Array | None:
        """See BasePredictor: None, the predictive is taken for a Gaussian."""
        return None

    def with_independent_outputs(self: Self) -> Self:
        """See Predictor: itself."""
        return self
