# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The coefficients of effects, estimated jointly on standardised residuals, with their covariance.

What a learnt base could express in its own inputs is regressed out of residuals and responses first (Frisch and Waugh
1933). Effects that change parameters of the mechanics are exact, found by steps of Gauss and Newton. The covariance is
a jackknife over blocks of pushes: it covers disturbances that neighbouring pushes share, and coefficients that depend
on a few pushes. No mechanics is exact: where pushes of different angles, or at different places of the outline,
disagree about a coefficient by more, the interval of its size is widened to that of a jackknife over these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise

import numpy as np

from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import JointShift, joint, joint_shift
from push_predictor.models.predictors import Cross
from push_predictor.residuals.candidates.candidate import Candidate, projected
from push_predictor.residuals.evidence.residualizer import Residualizer
from push_predictor.residuals.evidence.standardised import MOST_FITTED, Evidence, evidence_scale
from push_predictor.types import Array, IntArray

RIDGE = 1e-3  # share of a column's own square, for nearly collinear columns
MOST_STEPS = 10
GROUPS = 8  # of push angles, and of places on the outline
SINGULAR = 1e-12  # of the largest variance; less is rounding
LENGTHENED = 0.6  # of what a step promises: a larger fall shows that it is too short
LENGTHS = 5  # of a step that are tried
ENOUGH = 0.2  # nats: a step that gains less is the last


def estimated_effects(
    evidence: Evidence,
    candidates: Sequence[Candidate],
    own_inputs: Array | None = None,
    start: Array | None = None,
    *,
    of_size: bool = False,
) -> tuple[tuple[Effect, ...], Cross]:
    """The effects of these candidates, and the covariances between their coefficients (see ExtendedPredictor).

    own_inputs (n, m): controls to regress out of residuals and responses. start: coefficients (p,) near the solution.
    of_size: whether the covariance is for a size and not for a test against chance. It then also covers errors of the
    mechanics, as far as pushes of different angles, or at different places of the outline, disagree.
    """
    problem = _Problem.of(evidence, candidates, own_inputs)
    found, n = problem.solved(start), len(evidence.table)
    covariance = _jackknife(found.columns, found.residual, evidence.block, found.ridge)
    if of_size:
        for inputs in evidence.table.inputs[:, 1:].T:  # contact, angle
            other = _jackknife(found.columns, found.residual, _groups(inputs), found.ridge)
            covariance = _widened(covariance, other)
    covariance *= n / max(n - problem.residualizer.q.shape[1], 1)
    effects = tuple(
        replace(effect, covariance=covariance[part, part])
        for effect, part in zip(problem.effects(found.coefficients), problem.parts, strict=True)
    )
    pairs = combinations(range(len(effects)), 2)
    return effects, {(i, j): covariance[problem.parts[i], problem.parts[j]] for i, j in pairs}


@dataclass(frozen=True, eq=False)
class ExactFit:
    """An effect of a mechanism, fitted to residuals z (n, 3).

    shift (n, 3): its standardised shift. candidate: with the responses at the fit in place of those at zero. target
    (n, 3): what its columns leave of this, the effect leaves of z.
    """

    candidate: Candidate
    shift: Array
    target: Array


def exact_fit(evidence: Evidence, candidate: Candidate, z: Array, controls: Array) -> ExactFit:
    """The candidate fitted alone to residuals z (n, 3), the controls (n, m) regressed out.

    Where nothing is regressed out, windows spread over the session are enough for the coefficients.
    """
    problem = _Problem.of(evidence, [candidate], controls, z)
    if controls.shape[1] or candidate.nuisance is not None or len(z) <= MOST_FITTED:
        found = problem.solved()
    else:
        rows, few = evidence.thinned
        some = _Problem.of(few, [candidate.take(rows)], controls[rows], z[rows])
        found = problem.linearised(some.solved().coefficients)
    (effect,), there = problem.effects(found.coefficients), candidate
    if effect.exact:
        responses = np.einsum("nij,njp->nip", evidence.whitener, found.joint.responses(effect))
        there = replace(candidate, response=responses)
    target = z - projected(found.shift, candidate.nuisance) + there.columns @ found.coefficients
    return ExactFit(there, found.shift, target)


@dataclass(frozen=True, eq=False)
class _Problem:
    """Least squares of the residuals z (n, 3) by effects. start: the effects with coefficients of zero.

    nuisance (3 n, q): orthonormal columns that residuals and effects are projected off.
    """

    evidence: Evidence
    z: Array
    start: tuple[Effect, ...]
    residualizer: Residualizer
    nuisance: Array | None

    @staticmethod
    def of(
        evidence: Evidence,
        candidates: Sequence[Candidate],
        controls: Array | None,
        z: Array | None = None,
    ) -> _Problem:
        scale, start = evidence_scale(evidence), []
        for c in candidates:
            size = c.plain.shape[2]
            start.append(Effect(c.mechanism, c.covariate, c.basis, np.zeros(size), np.zeros((size, size)), scale))
        residualizer = Residualizer(np.empty((len(evidence.table), 0)) if controls is None else controls)
        nuisance = None if z is None else candidates[0].nuisance
        z = evidence.z if z is None else z
        return _Problem(evidence, z, tuple(start), residualizer, nuisance)

    @property
    def parts(self) -> list[slice]:
        """Where each effect's coefficients stand among all."""
        ends = np.cumsum([0, *(len(effect.coefficients) for effect in self.start)]).tolist()
        return [slice(low, high) for low, high in pairwise(ends)]

    def effects(self, coefficients: Array) -> tuple[Effect, ...]:
        return tuple(
            replace(effect, coefficients=coefficients[part])
            for effect, part in zip(self.start, self.parts, strict=True)
        )

    def linearised(self, coefficients: Array) -> _Linearised:
        """The problem about these coefficients."""
        evidence, effects = self.evidence, (*self.evidence.effects, *self.effects(coefficients))
        together = joint(evidence.mechanics, effects, evidence.push)
        whitener, count = self.evidence.whitener, len(self.evidence.effects)
        shift = np.einsum("nij,nj->ni", whitener, together.shift - self._before)
        columns = np.einsum("nij,njp->nip", whitener, np.concatenate(together.designs[count:], axis=2))
        ridge = RIDGE * np.sum(columns**2, axis=(0, 1)) + 1e-12
        return _Linearised(coefficients, self._cleared(self.z - shift), self._cleared(columns), ridge, shift, together)

    @cached_property
    def _before(self) -> Array:
        """Shift (n, 3) by the effects that the model has already."""
        return joint_shift(self.evidence.mechanics, self.evidence.effects, self.evidence.push)

    def _cleared(self, values: Array) -> Array:
        """Values (n, 3, ...) without the nuisance, and without what the inputs express."""
        return self.residualizer(projected(values, self.nuisance))

    def solved(self, start: Array | None = None) -> _Linearised:
        """The problem about its solution; start: coefficients (p,) to begin with, zero if None."""
        zero = np.concatenate([effect.coefficients for effect in self.start])
        now = self.linearised(zero if start is None else start)
        for _ in range(MOST_STEPS):
            square = np.einsum("nkp,nkq->pq", now.columns, now.columns) + np.diag(now.ridge)
            slope = np.einsum("nkp,nk->p", now.columns, now.residual) - now.ridge * now.coefficients
            step = np.linalg.solve(square, slope)
            now, fall = self._stepped(now, step, float(step @ slope))
            if fall < ENOUGH or not any(effect.exact for effect in self.start):
                break
        return now

    def _stepped(self, now: _Linearised, step: Array, promised: float) -> tuple[_Linearised, float]:
        """The problem after a step, lengthened or shortened, and the fall of its objective.

        promised: twice the fall of a quadratic objective. Where pushes begin to stick, a step is far too short: the
        derivatives of the rest of the data change there, and the objective falls by more.
        """
        before, best, most, length = now.objective(now.ridge), now, 0.0, 1.0
        for _ in range(LENGTHS):
            tried = self.linearised(now.coefficients + step * length)
            fall = before - tried.objective(now.ridge)
            if fall <= most:
                break
            best, most = tried, fall
            if fall < LENGTHENED * length * promised:
                break
            length *= 2.0
        return (best, most) if most > 0.0 else self._shortened(now, step)

    def _shortened(self, now: _Linearised, step: Array) -> tuple[_Linearised, float]:
        """The problem after the longest part of a step that is of use; as it was, if none is."""
        for k in range(1, LENGTHS):
            tried = self.linearised(now.coefficients + step * 0.5**k)
            if (fall := now.objective(now.ridge) - tried.objective(now.ridge)) > 0.0:
                return tried, fall
        return now, 0.0


@dataclass(frozen=True, eq=False)
class _Linearised:
    """A problem about coefficients (p,).

    residual (n, 3) and derivatives columns (n, 3, p) of the shift, without what inputs and nuisance express. ridge (p,)
    relative to the whole columns: what the inputs explain of them must not be blown up. shift (n, 3) standardised.
    """

    coefficients: Array
    residual: Array
    columns: Array
    ridge: Array
    shift: Array
    joint: JointShift

    def objective(self, ridge: Array) -> float:
        return 0.5 * float(np.sum(self.residual**2) + np.sum(ridge * self.coefficients**2))


def _groups(values: Array) -> IntArray:
    """At most GROUPS groups (n,) of windows with similar values, of about equal size; left and right slip are apart."""
    return np.searchsorted(np.quantile(values, np.arange(1, GROUPS) / GROUPS), values)


def _widened(covariance: Array, other: Array) -> Array:
    """A covariance (p, p) raised to another in every direction in which that one is larger."""
    values, vectors = np.linalg.eigh(covariance)
    kept = values > SINGULAR * max(values[-1], np.finfo(float).tiny)
    root = vectors[:, kept] * np.sqrt(values[kept])
    unit = vectors[:, kept] / np.sqrt(values[kept])
    ratio, turn = np.linalg.eigh(unit.T @ other @ unit)
    axes = root @ turn
    return np.asarray(covariance + (axes * np.maximum(ratio - 1.0, 0.0)) @ axes.T)


def _jackknife(columns: Array, residual: Array, block: IntArray, ridge: Array) -> Array:
    """Covariance (p, p) of least-squares coefficients over blocks (n,); columns (n, 3, p), residual (n, 3).

    ridge (p,): added to the columns' squares.
    """
    parts = [
        (columns[block == b].reshape(-1, columns.shape[2]), residual[block == b].ravel()) for b in np.unique(block)
    ]
    squares = np.stack([x.T @ x for x, _ in parts])
    scores = np.stack([x.T @ y for x, y in parts])
    square = squares.sum(axis=0) + np.diag(ridge)
    away = np.linalg.solve(square - squares, scores[:, :, None])[:, :, 0]
    return np.asarray((1.0 - 1.0 / len(parts)) * away.T @ away)
