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

"""The part of the predictor protocol that all predictors without effects share."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from push_predictor.models.effects.effect import Effect
from push_predictor.models.predictors.predictor import BasePredictor, Cross, InputLimits, Moments, Predictor, Shift
from push_predictor.models.push import Push

Self = TypeVar("Self")


class WithoutEffects:
    """A predictor that is its own base."""

    @property
    def base(self: Self) -> Self:
        """See Predictor: itself."""
        return self

    @property
    def effects(self) -> tuple[Effect, ...]:
        """See Predictor: none."""
        return ()

    @property
    def cross(self) -> Cross:
        """See Predictor: none."""
        return {}

    @property
    def needs(self) -> tuple[str, ...]:
        """See Predictor: none."""
        return ()

    @property
    def covariates(self) -> tuple[str, ...]:
        """See Predictor: none."""
        return ()

    @property
    def own_limits(self) -> InputLimits | None:
        """See Predictor: None."""
        return None

    def completed(self, push: Push) -> Push:
        """See Predictor."""
        return push

    def with_effects(self, moments: Moments, push: Push) -> Moments:
        """See Predictor."""
        return moments

    def of_outcomes(self, learnt: Moments, push: Push) -> Moments:
        """See BasePredictor."""
        return learnt

    def shift(self, push: Push) -> Shift:
        """See Predictor: zero."""
        return Shift(np.zeros((len(push.inputs), 3)), np.zeros((len(push.inputs), 3, 3)))

    def with_base(self, base: BasePredictor) -> Predictor:
        """See Predictor."""
        return base
