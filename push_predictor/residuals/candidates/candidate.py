# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A candidate: one mechanism whose strength depends on one covariate, as columns of a regression."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import products
from push_predictor.residuals.evidence.drivers import CONSTANT
from push_predictor.residuals.evidence.inputs_basis import Kind
from push_predictor.residuals.evidence.standardised import Evidence, whitened_response
from push_predictor.types import Array

SPEED = "velocity"


@dataclass(frozen=True, eq=False)
class Candidate:
    """A mechanism (None: the generic polynomial) whose strength depends on a covariate through one basis.

    response (n, 3, p): standardised outcome per unit of the parameters. values (n, m): the basis at the windows.
    nuisance (3 n, q): orthonormal columns that the candidate is projected off, see Nuisance. own: whether the
    covariate is a function of the inputs of a learnt base, as the side is where the base folds none.
    """

    mechanism: str | None
    covariate: str
    basis: DriverBasis
    response: Array
    values: Array | None = None
    nuisance: Array | None = None
    own: bool = False

    @cached_property
    def columns(self) -> Array:
        """Standardised columns (n, 3, p * m), p first, projected off the nuisance."""
        return projected(self.plain, self.nuisance)

    @property
    def plain(self) -> Array:
        """Standardised columns (n, 3, p * m), p first: the effect itself."""
        if self.values is None:
            return self.response
        return products(self.response, self.values)

    @property
    def kind(self) -> Kind:
        """Whether the effect depends on another covariate, on the speed, or on the inputs alone."""
        if self.covariate == CONSTANT or self.own:
            return "constant"
        return "speed" if self.covariate == SPEED else "driven"

    @property
    def label(self) -> tuple[str | None, str]:
        """Mechanism and covariate, whatever the basis."""
        return self.mechanism, self.covariate

    def same_as(self, other: Candidate) -> bool:
        """Whether two are the same effect in the same form."""
        return self.label == other.label and self.basis == other.basis


def projected(values: Array, nuisance: Array | None) -> Array:
    """Values (n, 3, ...) projected off orthonormal columns (3 n, q)."""
    if nuisance is None:
        return values
    flat = values.reshape(len(nuisance), -1)
    return np.asarray(flat - nuisance @ (nuisance.T @ flat)).reshape(values.shape)


def candidate(evidence: Evidence, mechanism: str | None, covariate: str, basis: DriverBasis) -> Candidate:
    """One candidate on these windows, projected off nothing."""
    values = basis.values(evidence.table.covariates, len(evidence.table))
    return Candidate(mechanism, covariate, basis, whitened_response(evidence, mechanism), values)
