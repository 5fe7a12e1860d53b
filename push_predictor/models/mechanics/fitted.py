"""The forward model with values for its parameters: what a model uses and a model file keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.types import Array


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
        return tuple(dict.fromkeys(need for name in self.values for need in BY_NAME[name].needs))

    def displacement(self, inputs: Array, duration: Array, covariates: Mapping[str, Array] | None = None) -> Array:
        """Displacement (n, 3: dx, dy in m, dtheta in rad); see PushMechanics.displacement."""
        return self.mechanics.displacement(self.values, inputs, duration, covariates)
