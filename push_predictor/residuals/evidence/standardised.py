# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Standardised residuals: what a deployed model fails to explain, in units of its own predicted deviation.

And the parts of a table: pushes that are held out to the end, and blocks of neighbours.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from push_predictor.evaluation.metrics import whitener_of
from push_predictor.models.effects.effect import Effect, generic_responses
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanisms import mechanism_named
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, BoolArray, IntArray

FEWEST_PUSHES = 12  # of a table, or of a part of one, that anything is concluded from
HELD_OUT_BLOCK = 10  # pushes
FEWEST_HELD_OUT = 9  # guards against few pushes that all lie in analysis: their blocks are smaller
EVERY = 3  # one block in so many is held out
RULE = f"every third block of up to {HELD_OUT_BLOCK} successive pushes is held out"
BLOCK = 4  # neighbouring pushes may share disturbances that no covariate records
ACCURACY_OF_FITS = 3e-3  # relative, of displacements
MOST_FITTED = 600  # windows of a fit that compares candidates
# Prior standard deviations of a parameter, to both sides: 95 % of rigs lie between. The search takes the secant over
# this range, which for a large effect is nearer to what it does than the tangent.
SECANT = 2.0
FEWEST_BLOCKS = 100  # with fewer, blocks are smaller: a bootstrap over few blocks has little power


@dataclass(frozen=True, eq=False)
class Evidence:
    """n windows with covariates and their residuals under one model.

    residual (n, 3): m, m, rad. whitener (n, 3, 3): L^-1, L L' the predicted covariance. mechanics: what effects act on.
    effects: those that the model has already.
    """

    table: PushTable
    residual: Array
    whitener: Array
    mechanics: FittedMechanics
    effects: tuple[Effect, ...] = ()

    @property
    def z(self) -> Array:
        """Standardised residuals (n, 3)."""
        return np.asarray(np.einsum("nij,nj->ni", self.whitener, self.residual))

    @property
    def push(self) -> Push:
        """The windows as the mechanisms' input."""
        return Push.of(self.table)

    @cached_property
    def block(self) -> IntArray:
        """Block number (n,): neighbouring pushes share one; see blocks_of."""
        return blocks_of(self.table)

    @cached_property
    def responses(self) -> dict[str | None, Array]:
        """Those that are known, by mechanism; see whitened_response."""
        return {}

    @cached_property
    def thinned(self) -> Evidence:
        """Of at most MOST_FITTED windows spread over the session; enough for a fit."""
        return self.take(np.linspace(0, len(self.table) - 1, min(MOST_FITTED, len(self.table))).astype(np.int64))

    def take(self, rows: IntArray | BoolArray) -> Evidence:
        """The given rows."""
        taken = self.table.take(rows), self.residual[rows], self.whitener[rows]
        return Evidence(*taken, self.mechanics, self.effects)


def evidence_of(model: PushModel, table: PushTable) -> Evidence:
    """Residuals of a table under a model that was not trained on it.

    A learnt model's outputs are standardised one by one. A strong correlation of the outputs would give the largest
    weight to small parts of the residual: in one recording, the second order of an effect was found before the effect
    itself.
    """
    predictor = model.predictor.with_independent_outputs()
    mean, covariance, _ = predictor.moments(Push.of(table))
    residual = table.outcomes - mean
    return Evidence(table, residual, whitener_of(covariance), mechanics_under(model), model.predictor.effects)


def mechanics_under(model: PushModel) -> FittedMechanics:
    """What effects of a push model act on: its own mechanics, or the textbook's for a learnt one without.

    Shifts are differences, and their fits take many: less accuracy than that of a prediction is enough.
    """
    fitted = model.predictor.base.mechanics
    return replace(fitted, mechanics=replace(fitted.mechanics, accuracy=ACCURACY_OF_FITS))


def push_order(table: PushTable) -> IntArray:
    """Number (n,) of each window's push, in order of first appearance."""
    index = {push: k for k, push in enumerate(table.pushes)}
    return np.array([index[push] for push in table.push_id.tolist()], dtype=np.int64)


def blocks_of(table: PushTable) -> IntArray:
    """Block number (n,): up to BLOCK neighbouring pushes share one; single pushes where there are few."""
    return np.asarray(push_order(table) // max(1, min(BLOCK, len(table.pushes) // FEWEST_BLOCKS)))


def held_out_rows(table: PushTable) -> BoolArray:
    """Mask (n,) of the rows of held-out pushes: interleaved blocks, so that both parts span the whole session."""
    block = max(1, min(HELD_OUT_BLOCK, len(table.pushes) // FEWEST_HELD_OUT))
    return np.asarray((push_order(table) // block) % EVERY == EVERY - 1)


def digest_of(table: PushTable) -> str:
    """SHA-256 of a table's inputs, durations and outcomes, in hexadecimal."""
    digest = hashlib.sha256()
    for column in (table.inputs, table.duration, table.outcomes):
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def whitened_response(evidence: Evidence, mechanism: str | None) -> Array:
    """Standardised outcome per unit of a mechanism's parameters (n, 3, p); None is the generic polynomial."""
    if mechanism not in evidence.responses:
        evidence.responses[mechanism] = _whitened_response(evidence, mechanism)
    return evidence.responses[mechanism]


def _whitened_response(evidence: Evidence, mechanism: str | None) -> Array:
    if mechanism is None:
        response = generic_responses(evidence.mechanics, evidence.push, evidence_scale(evidence))
    else:
        response = mechanism_named(mechanism).response(evidence.mechanics, evidence.push, SECANT)
    return np.asarray(np.einsum("nij,njp->nip", evidence.whitener, response))


def evidence_scale(evidence: Evidence) -> Array:
    """Unit of the generic responses (3,): root mean square residual per metre that the tip travels."""
    travel = evidence.table.inputs[:, 0] * evidence.table.duration
    return np.asarray(np.sqrt(np.mean(evidence.residual**2, axis=0)) / np.sqrt(np.mean(travel**2)))
