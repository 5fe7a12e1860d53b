# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The data that an effect rests on: partial residuals, expressed as the strength of the effect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.models.effects.driver_basis import DriverBasis, columns_of
from push_predictor.models.effects.effect import Effect, design_of
from push_predictor.models.effects.exact import joint, joint_shift
from push_predictor.models.mechanisms import mechanism_named
from push_predictor.models.pushes import Push
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.standardised import evidence_of, mechanics_under
from push_predictor.residuals.outcome import Trace
from push_predictor.types import Array, BoolArray, IntArray

DRAWS = 400
CENTRAL = 1.96  # standard deviations that cover 95 % of a Gaussian
LEAST_PUSHES = 3  # of a bin that is shown


@dataclass(frozen=True, eq=False)
class Rows:
    """n windows, their standardised residuals (n, 3) after all effects, and the whitener (n, 3, 3)."""

    table: PushTable
    unexplained: Array
    whitener: Array


@dataclass(frozen=True, eq=False)
class Strength:
    """An effect as q parameters that depend on its covariate.

    pattern (p, q): of the mechanism's p responses. coefficients (q, m) and their covariance (q, m, m). share: of the
    fitted coefficients' sum of squares that the pattern covers, 1 unless the mechanism is unknown.
    """

    effect: Effect
    names: tuple[str, ...]
    units: tuple[str, ...]
    pattern: Array
    coefficients: Array
    covariance: Array
    share: float

    def curve(self, covariates: Mapping[str, Array], n: int) -> tuple[Array, Array]:
        """Fitted parameters (n, q) and half of their 95 % band (n, q)."""
        values = self.effect.basis.values(covariates, n)
        variance = np.einsum("nm,qmk,nk->nq", values, self.covariance, values)
        return values @ self.coefficients.T, CENTRAL * np.sqrt(np.maximum(variance, 0.0))


@dataclass(frozen=True, eq=False)
class Binned:
    """Position of each bin (b,), and the q parameters' estimates with their 95 % ends (b, q)."""

    place: Array
    value: Array
    low: Array
    high: Array


def analysis_rows(trace: Trace) -> Rows:
    """Analysis pushes under the extended model, or under the deployed model minus the effects if there is none."""
    if trace.extended is not None:
        evidence = evidence_of(trace.extended, trace.analysis)
        return Rows(trace.analysis, evidence.z, evidence.whitener)
    evidence = evidence_of(trace.model, trace.analysis)
    shift = sum((shift_of(trace, term, trace.analysis) for term in trace.terms), np.zeros_like(evidence.residual))
    unexplained = replace(evidence, residual=evidence.residual - shift)
    return Rows(trace.analysis, unexplained.z, unexplained.whitener)


def held_out_rows(trace: Trace) -> Rows:
    """Held-out pushes under the model with the effects."""
    after = trace.held_out.after
    whitener = np.asarray(np.linalg.inv(np.linalg.cholesky(after.covariance)))
    return Rows(trace.held_out.table, np.einsum("nij,nj->ni", whitener, after.observed - after.mean), whitener)


def shift_of(trace: Trace, effect: Effect, table: PushTable) -> Array:
    """Shift of the mean (n, 3) by an effect."""
    return joint_shift(mechanics_under(trace.model), [effect], _push(table))


def strength_of(effect: Effect, table: PushTable) -> Strength:
    """The effect's physical parameters; for an unknown mechanism its strongest pattern, scaled to RMS 1."""
    m = columns_of(effect.basis)
    coefficients = effect.coefficients.reshape(-1, m)
    p = len(coefficients)
    blocks = effect.covariance.reshape(p, m, p, m)
    if effect.mechanism is not None:
        parameters = mechanism_named(effect.mechanism).parameters
        own = np.array([blocks[j, :, j] for j in range(p)])
        names, units = tuple(q.name for q in parameters), tuple(q.unit for q in parameters)
        return Strength(effect, names, units, np.eye(p), coefficients, own, 1.0)
    left, size, _ = np.linalg.svd(coefficients, full_matrices=False)
    u = left[:, 0]
    along = u @ coefficients
    along_values = effect.basis.values(table.covariates, len(table)) @ along
    rms = max(float(np.sqrt(np.mean(along_values**2))), np.finfo(float).tiny)
    own = np.einsum("p,pmqk,q->mk", u, blocks, u)[None] / rms**2
    share = float(size[0] ** 2 / max(float(np.sum(size**2)), np.finfo(float).tiny))
    names = ("Strength of the fitted pattern (RMS 1)",)
    return Strength(effect, names, ("1",), u[:, None] * rms, along[None] / rms, own, share)


def responses(trace: Trace, strength: Strength, rows: Rows) -> Array:
    """Standardised outcome (n, 3, q) per unit of each of the q parameters."""
    effect = strength.effect
    on, push = mechanics_under(trace.model), _push(rows.table)
    if effect.exact:
        bare = joint(on, [effect], push).responses(effect)
    else:
        bare = design_of(effect.mechanism, DriverBasis("constant"), on, push, effect.outcome_scale)
    return np.asarray(np.einsum("nij,njp,pq->niq", rows.whitener, bare, strength.pattern))


def binned(strength: Strength, rows: Rows, response: Array, place: Array, bins: IntArray) -> Binned:
    """The parameters in each bin (n,) of windows by least squares, with 95 % ends from a bootstrap of its pushes.

    place (n,): position of a window on the axis. Windows of bin -1 and bins of fewer than three pushes are dropped.
    """
    fitted = strength.curve(rows.table.covariates, len(rows.table))[0]
    target = rows.unexplained + np.einsum("nkq,nq->nk", response, fitted)
    found = [_of_bin(target, response, rows.table.push_id, place, bins == b) for b in np.unique(bins[bins >= 0])]
    kept = [each for each in found if each is not None]
    q = response.shape[2]
    stacked = np.array(kept).reshape(-1, 4, q)
    return Binned(stacked[:, 0, 0], stacked[:, 1], stacked[:, 2], stacked[:, 3])


def per_push(strength: Strength, rows: Rows, response: Array, place: Array) -> tuple[Array, Array]:
    """Position (k,) and parameters (k, q) of each push; NaN where the response is too small."""
    _, push = np.unique(rows.table.push_id, return_inverse=True)
    times = np.bincount(push)
    square, score = (_sums(push, values) for values in (_squares(response), _scores(response, rows.unexplained)))
    fitted = strength.curve(rows.table.covariates, len(rows.table))[0]
    mean = _sums(push, fitted) / times[:, None]
    informative = square >= 0.1 * np.median(square, axis=0)
    value = np.divide(score, square, out=np.full(score.shape, np.nan), where=informative & (square > 0.0)) + mean
    return np.bincount(push, place) / times, value


def _of_bin(target: Array, response: Array, push_id: np.ndarray, place: Array, rows: BoolArray) -> Array | None:
    names, push = np.unique(push_id[rows], return_inverse=True)
    if len(names) < LEAST_PUSHES:
        return None
    r, z = response[rows], target[rows]
    square = _sums(push, np.einsum("nkp,nkq->npq", r, r))
    score = _sums(push, np.einsum("nkp,nk->np", r, z))
    if not np.all(np.einsum("npp->p", square) > 0.0):
        return None
    weights = push_bootstrap(names, draws=DRAWS)
    value = _solved(square.sum(axis=0)[None], score.sum(axis=0)[None])[0]
    draws = _solved(np.tensordot(weights, square, axes=1), weights @ score)
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    return np.stack([np.full(len(value), place[rows].mean()), value, low, high])


def _solved(square: Array, score: Array) -> Array:
    return np.asarray(np.einsum("dpq,dq->dp", np.linalg.pinv(square, rcond=1e-9, hermitian=True), score))


def _sums(push: IntArray, values: Array) -> Array:
    sums = np.zeros((int(push.max()) + 1, *values.shape[1:]))
    np.add.at(sums, push, values)
    return sums


def _squares(response: Array) -> Array:
    return np.asarray(np.sum(response**2, axis=1))


def _scores(response: Array, residual: Array) -> Array:
    return np.asarray(np.einsum("nkq,nk->nq", response, residual))


def _push(table: PushTable) -> Push:
    return Push(table.inputs, table.duration, table.covariates)
