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

"""An effect that a base model lacks: a mechanism, the covariate it depends on, and its strength; added to the mean."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanisms import LIBRARY, REFINEMENTS, Push
from push_predictor.models.mechanisms.mechanism import Mechanism
from push_predictor.types import Array

GENERIC_TERMS = 6  # of the polynomial, for each output


@dataclass(frozen=True, eq=False)
class Effect:
    """Shift of the mean: sum over parameters p and columns m of the basis, response_p x basis_m x coefficient_pm.

    mechanism: of LIBRARY or REFINEMENTS, or None for the generic one. coefficients (p * m,), p first; covariance of
    them (p * m, p * m). outcome_scale (3,): unit of the generic responses (m, m, rad per metre of the tip's path).
    exact: the sum over the columns changes parameters of the mechanics, and the shift is what that changes (see
    exact.py); otherwise the shift is linear in the coefficients, as effects of older model files are.
    """

    mechanism: str | None
    covariate: str
    basis: DriverBasis
    coefficients: Array
    covariance: Array
    outcome_scale: Array
    exact: bool = False

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the covariates that it depends on."""
        own = () if self.mechanism is None else mechanism_named(self.mechanism).needs
        return tuple(dict.fromkeys([*self.basis.drivers, *own]))

    def design(self, physics: AnalyticalPush, push: Push) -> Array:
        """The design matrices (n, 3, p * m) of a linear effect: shift = design @ coefficients."""
        return design_of(self.mechanism, self.basis, physics, push, self.outcome_scale)

    def shift(self, physics: AnalyticalPush, push: Push) -> tuple[Array, Array]:
        """Shift of the mean (n, 3) by a linear effect, and its covariance (n, 3, 3)."""
        design = self.design(physics, push)
        return design @ self.coefficients, design @ self.covariance @ np.transpose(design, (0, 2, 1))


def design_of(
    mechanism: str | None, basis: DriverBasis, physics: AnalyticalPush, push: Push, outcome_scale: Array
) -> Array:
    """The design matrices (n, 3, p * m) of an effect: products of responses and basis columns."""
    responses = responses_of(mechanism, physics, push, outcome_scale)
    return products(responses, basis.values(push.covariates, len(push.inputs)))


def responses_of(mechanism: str | None, physics: AnalyticalPush, push: Push, outcome_scale: Array) -> Array:
    """Derivatives (n, 3, p) of the outcome by the parameters of a mechanism."""
    if mechanism is None:
        return generic_responses(physics, push, outcome_scale)
    return mechanism_named(mechanism).response(physics, push)


def products(responses: Array, values: Array) -> Array:
    """Products (n, 3, p * m), p first, of responses (n, 3, p) and columns (n, m) of a basis."""
    return np.asarray((responses[:, :, :, None] * values[:, None, None, :]).reshape(len(responses), 3, -1))


def generic_responses(physics: AnalyticalPush, push: Push, outcome_scale: Array) -> Array:
    """A low-order polynomial of contact and angle for each output (n, 3, 3 * 6), per metre of the tip's path.

    outcome_scale (3,): the unit, m, m and rad per metre. The contact enters by the lever arm of its normal force about
    the centre of friction, as a fraction of the limit surface's length, so that an outline's symmetries are folded.
    """
    path_length = push.inputs[:, 0] * push.duration
    basis = path_length[:, None] * _polynomial(physics, push.inputs)
    n, m = basis.shape
    responses = np.zeros((n, 3, 3 * m))
    for k in range(3):
        responses[:, k, k * m : (k + 1) * m] = outcome_scale[k] * basis
    return responses


def _polynomial(physics: AnalyticalPush, inputs: Array) -> Array:
    _, contact, angle = inputs.T
    normal = physics.outline.inward_normal(contact)
    arm = physics.outline.point(contact) - np.asarray(physics.support.centre)
    lever = (arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0]) / physics.support.length
    return np.column_stack([np.ones_like(angle), lever, angle, lever * angle, lever**2, angle**2])


def generic_width() -> int:
    """Number of responses of the generic mechanism."""
    return 3 * GENERIC_TERMS


def mechanism_named(name: str) -> Mechanism:
    """The mechanism of that name. Raises KeyError if there is none."""
    return {mechanism.name: mechanism for mechanism in (*LIBRARY, *REFINEMENTS)}[name]
