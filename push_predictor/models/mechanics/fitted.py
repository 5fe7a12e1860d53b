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

"""The forward model with values for its parameters: what a model uses and a model file keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.limit_surface import Support
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.pressure import patch
from push_predictor.types import Array

NO_CHANGES: Mapping[str, Array] = MappingProxyType({})
ACCURACY_OF_SHIFT = 1e-3  # relative; of a shift it is 0.2 %, six times as fast as with the model's own accuracy
RECORDING = "recording"  # the covariate that numbers recordings with different supports


@dataclass(frozen=True, eq=False)
class FittedMechanics:
    """Mechanics with the values of its free parameters; the others have their textbook values.

    covariance (p, p): of the values, in their order; zero where nothing was fitted.
    """

    mechanics: PushMechanics
    values: dict[str, float] = field(default_factory=dict)
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the covariates that every push must bring."""
        names = [RECORDING] if self.mechanics.supports else []
        names += [need for name in self.values for need in BY_NAME[name].needs]
        return tuple(dict.fromkeys(names))

    def displacement(
        self,
        inputs: Array,
        duration: Array,
        covariates: Mapping[str, Array] | None = None,
        changes: Mapping[str, Array] = NO_CHANGES,
    ) -> Array:
        """Displacement (n, 3: dx, dy in m, dtheta in rad); see PushMechanics.displacement.

        changes: by name of a parameter, what is added to its value at each push (n,).
        """
        changed = {name: self.value(name) + change for name, change in changes.items()}
        return self.mechanics.displacement({**self.values, **changed}, inputs, duration, covariates)

    def value(self, name: str) -> float:
        """The value of a parameter: the fitted one, or the textbook's."""
        return self.values.get(name, BY_NAME[name].textbook)

    def ellipsoid(self) -> AnalyticalPush:
        """The ellipsoidal model with the same contact friction, and the length and centre of the pressure.

        Of recordings with different supports it takes the mean. Responses of effects are computed from it.
        """
        mechanics = self.mechanics
        supports = [mechanics.support] if mechanics.support is not None else list(mechanics.supports.values())
        supports = supports or [patch(mechanics.outline, self.value("rim_exponent"))]
        x, y = np.mean([support.centre for support in supports], axis=0)
        length = float(np.mean([support.length for support in supports]))
        centre = float(x) + self.value("centre_x"), float(y) + self.value("centre_y")
        friction = self.value("contact_friction")
        return AnalyticalPush(mechanics.outline, mechanics.pusher_radius, friction, Support(centre, length))


def mechanics_of(physics: AnalyticalPush) -> FittedMechanics:
    """The analytical model as mechanics with one parameter, for what changes of parameters shift.

    A shift is a difference of displacements, whose errors are alike: it needs less accuracy than a displacement.
    """
    mechanics = replace(physics.mechanics, accuracy=ACCURACY_OF_SHIFT)
    return FittedMechanics(mechanics, {"contact_friction": physics.contact_friction}, np.zeros((1, 1)))
