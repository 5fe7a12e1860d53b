# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Candidates as parameters of a joint fit: the changes that they make to the mechanics of a model.

So the ladder of the fitted mechanics (models/mechanics/ladder.py) can choose among effects, constant or along a
covariate, about any model whose mean is mechanics.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.models.effects.exact import changes_of, within_limits
from push_predictor.models.mechanics.fit import FitRows
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.ladder import Group
from push_predictor.models.mechanics.parameters import BY_NAME, MechanicsParameter, ParameterValues
from push_predictor.models.mechanisms import mechanism_named
from push_predictor.models.pushes import Push
from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.types import Array

ACCURACY = 1e-3  # relative, of displacements: derivatives are taken over short steps
WEAK = 0.5  # prior standard deviation, as a share of the largest, of what the mechanics have no prior for


@dataclass(frozen=True, eq=False)
class ParameterChanges:
    """Changes of a model's mechanics on n windows, by coefficients of candidates.

    A coefficient changes a quantity of the mechanics by a column of its candidate's basis. groups: the coefficients of
    each candidate.
    """

    evidence: Evidence
    groups: tuple[Group, ...]
    columns: Mapping[str, tuple[Candidate, str, int]]  # candidate, quantity, column of its basis

    @staticmethod
    def of(evidence: Evidence, candidates: Sequence[Candidate]) -> ParameterChanges:
        """The changes that these candidates make; names of coefficients begin with the quantity."""
        groups, columns = [], dict[str, tuple[Candidate, str, int]]()
        for number, c in enumerate(candidates):
            mechanism, m = mechanism_named(str(c.mechanism)), 1 if c.values is None else c.values.shape[1]
            names = enumerate(mechanism.quantities)
            keys = [(name, k, _key(c, name, number, i, k)) for i, name in names for k in range(m)]
            groups.append(tuple(key for *_, key in keys))
            columns.update({key: (c, name, k) for name, k, key in keys})
        return ParameterChanges(evidence, tuple(groups), columns)

    def rows(self) -> FitRows:
        """The windows for a fit: outcomes under the mechanics with the effects that the model has already."""
        evidence, table = self.evidence, self.evidence.table
        outcomes = evidence.residual + self.displacement({}, table.inputs, table.duration, table.covariates)
        push = np.unique(table.push_id, return_inverse=True)[1]
        return FitRows(table.inputs, table.duration, outcomes, push, table.covariates, self._parameters())

    def displacement(
        self, values: ParameterValues, inputs: Array, duration: Array, covariates: Mapping[str, Array] | None = None
    ) -> Array:
        """Displacement (n, 3) of the windows; values: of the coefficients, each a number or (n,)."""
        push, n = Push(inputs, duration, covariates or {}), len(inputs)
        changes = dict(changes_of(self.evidence.effects, push))
        for key, value in values.items():
            strength = np.broadcast_to(np.asarray(value, dtype=np.float64), n)
            c, quantity, k = self.columns[key]
            changes[quantity] = changes.get(quantity, 0.0) + strength * c.basis.values(push.covariates, n)[:, k]
        return np.asarray(self._mechanics.displacements([within_limits(changes)], push)[0])

    @property
    def _mechanics(self) -> FittedMechanics:
        fitted = self.evidence.mechanics
        return replace(fitted, mechanics=replace(fitted.mechanics, accuracy=ACCURACY))

    def _parameters(self) -> dict[str, MechanicsParameter]:
        """The coefficients as parameters of a fit, which are zero in the model."""
        fitted, found = self.evidence.mechanics, dict[str, MechanicsParameter]()
        for key, (c, quantity, _) in self.columns.items():
            known, value = BY_NAME[quantity], fitted.value(quantity)
            if c.basis.is_constant:
                found[key] = replace(known, name=key, textbook=0.0, low=known.low - value, high=known.high - value)
            else:
                found[key] = _of_size(key, max(value - known.low, known.high - value))
        return found


def _key(c: Candidate, quantity: str, number: int, parameter: int, column: int) -> str:
    """A name for a coefficient of candidate `number`: that of the quantity itself if it is constant."""
    if c.basis.is_constant:
        return quantity
    return f"{quantity} {number} {parameter} {column}"


def _of_size(key: str, largest: float) -> MechanicsParameter:
    return MechanicsParameter(key, "", 0.0, -largest, largest, WEAK * largest, "", "")
