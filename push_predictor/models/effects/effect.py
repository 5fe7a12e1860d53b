# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""An effect that a base model lacks: a mechanism, the covariate it depends on, and its strength; added to the mean."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanisms import mechanism_named
from push_predictor.models.pushes import Push
from push_predictor.types import Array

GENERIC_WIDTH = 3 * 6  # responses of the generic mechanism: the terms of a polynomial for each output


@dataclass(frozen=True, eq=False)
class Effect:
    """What an effect changes: sum over parameters p and columns m of the basis, parameter_p x basis_m x coefficient_pm.

    mechanism: of LIBRARY or REFINEMENTS, or None for the generic one. coefficients (p * m,), p first; covariance of
    them (p * m, p * m). A mechanism's sum over the columns changes parameters of the mechanics, and the mean shifts by
    what that changes (exact.py). The generic effect has no mechanics: the shift is linear in its coefficients, with the
    responses of `generic_responses`; outcome_scale (3,): their unit (m, m, rad per metre of the tip's path).
    """

    mechanism: str | None
    covariate: str
    basis: DriverBasis
    coefficients: Array
    covariance: Array
    outcome_scale: Array

    @property
    def exact(self) -> bool:
        """Whether it changes parameters of the mechanics."""
        return self.mechanism is not None

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the parameters of the mechanics that it changes."""
        return () if self.mechanism is None else mechanism_named(self.mechanism).quantities

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of the covariates that it depends on."""
        own = () if self.mechanism is None else mechanism_named(self.mechanism).needs
        return tuple(dict.fromkeys([*self.basis.drivers, *own]))

    def design(self, mechanics: FittedMechanics, push: Push) -> Array:
        """The design matrices (n, 3, p * m) of a generic effect: shift = design @ coefficients."""
        return design_of(self.mechanism, self.basis, mechanics, push, self.outcome_scale)


def design_of(
    mechanism: str | None, basis: DriverBasis, mechanics: FittedMechanics, push: Push, outcome_scale: Array
) -> Array:
    """The design matrices (n, 3, p * m) of an effect: products of responses and basis columns."""
    if mechanism is None:
        responses = generic_responses(mechanics, push, outcome_scale)
    else:
        responses = mechanism_named(mechanism).response(mechanics, push)
    return products(responses, basis.values(push.covariates, len(push.inputs)))


def products(responses: Array, values: Array) -> Array:
    """Products (n, 3, p * m), p first, of responses (n, 3, p) and columns (n, m) of a basis."""
    size = responses.shape[2] * values.shape[1]
    return np.asarray((responses[:, :, :, None] * values[:, None, None, :]).reshape(len(responses), 3, size))


def generic_responses(mechanics: FittedMechanics, push: Push, outcome_scale: Array) -> Array:
    """A low-order polynomial of contact and angle for each output (n, 3, 3 * 6), per metre of the tip's path.

    outcome_scale (3,): the unit, m, m and rad per metre. The contact enters by the lever arm of its normal force about
    the centre of friction, as a fraction of the limit surface's length, so that an outline's symmetries are folded.
    """
    path_length = push.inputs[:, 0] * push.duration
    basis = path_length[:, None] * _polynomial(mechanics, push.inputs)
    n, m = basis.shape
    responses = np.zeros((n, 3, 3 * m))
    for k in range(3):
        responses[:, k, k * m : (k + 1) * m] = outcome_scale[k] * basis
    return responses


def _polynomial(mechanics: FittedMechanics, inputs: Array) -> Array:
    _, contact, angle = inputs.T
    surface, normal = mechanics.ellipsoid, mechanics.outline.inward_normal(contact)
    arm = mechanics.outline.point(contact) - surface.centre
    lever = (arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0]) / surface.length
    return np.column_stack([np.ones_like(angle), lever, angle, lever * angle, lever**2, angle**2])
