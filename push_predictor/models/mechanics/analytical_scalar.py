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

"""The analytical model in plain numbers, for single pushes: see scalar.mechanics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite

import numpy as np

from push_predictor.geometry.nearest import ContactAt, Nearest, contact_on, nearest_on
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.scalar.mechanics import FEW, ScalarMechanics
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class ScalarAnalyticalPush(AnalyticalPush):
    """AnalyticalPush that computes few pushes in plain numbers. Made by `scalar_analytical`; `replace` keeps caches.

    nearest: the outline's nearest point. contact_at: a contact's point and inward normal.
    """

    nearest: Nearest = field(kw_only=True)
    contact_at: ContactAt = field(kw_only=True)

    def displacement(self, inputs: Array, duration: Array) -> Array:
        """See AnalyticalPush."""
        if not 0 < len(inputs) <= FEW:
            return super().displacement(inputs, duration)
        pushes = [(*row, seconds) for row, seconds in zip(inputs.tolist(), duration.tolist(), strict=True)]
        if not all(_valid(*push) for push in pushes):
            return super().displacement(inputs, duration)  # raises the error
        return np.array([self._scalar.moved(*push) for push in pushes])

    def displacements(self, others: Sequence[AnalyticalPush], inputs: Array, duration: Array) -> Array:
        """See AnalyticalPush."""
        if len(inputs) > FEW:
            return super().displacements(others, inputs, duration)
        return np.stack([other.displacement(inputs, duration) for other in others])

    @cached_property
    def _scalar(self) -> ScalarMechanics:
        values = {"contact_friction": self.contact_friction}
        return ScalarMechanics(self.mechanics, values, nearest=self.nearest, contact_at=self.contact_at)


def scalar_analytical(physics: AnalyticalPush) -> ScalarAnalyticalPush:
    """The same model, prepared for single pushes."""
    outline = physics.outline
    return ScalarAnalyticalPush(
        outline,
        physics.pusher_radius,
        physics.contact_friction,
        physics.support,
        nearest=nearest_on(outline),
        contact_at=contact_on(outline),
    )


def _valid(speed: float, contact: float, angle: float, seconds: float) -> bool:
    return speed >= 0.0 and seconds >= 0.0 and isfinite(speed + contact + angle + seconds)
