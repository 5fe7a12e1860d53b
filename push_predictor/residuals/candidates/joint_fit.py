# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Effects fitted together, exactly, and what they gain on blocks of pushes that they were not fitted to.

Where a learnt base may have missed a function of its inputs, the residuals of training windows stand under those of new
ones: what is the same in both is regressed out (Frisch and Waugh 1933). Effects act on new windows only, so they are
changes since training. The fit is by steps of Gauss and Newton with the weights of Student's t noise; the windows of a
push share their deviation and count accordingly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, pairwise

import numpy as np

from push_predictor.models.effects.covariates import CUMULATIVE
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint, joint_shift
from push_predictor.models.mechanics.prior import window_weights
from push_predictor.models.predictors import Cross
from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.evidence.residualizer import Residualizer, sums_by
from push_predictor.residuals.evidence.standardised import Evidence, evidence_scale, push_order
from push_predictor.types import Array, IntArray

DEGREES = 5.0  # of freedom of Student's t: single windows that slip or hit a corner must not decide
RIDGE = 1e-3  # share of a column's own square, for nearly collinear columns
FOLDS = 5
MOST_STEPS = 10
ENOUGH = 0.2  # nats: a step that gains less is the last
LENGTHENED = 0.6  # of what a step promises: a larger fall shows that it is too short
LENGTHS = 5  # of a step that are tried
GROUPS = 8  # of push angles, and of places on the outline
SINGULAR = 1e-12  # of the largest variance; less is rounding


@dataclass(frozen=True, eq=False)
class FitRows:
    """n new windows, and under them those of training where there are any, with the controls (N, m) of all."""

    evidence: Evidence
    training: Evidence | None = None
    controls: Array = field(default_factory=lambda: np.empty((0, 0)))

    @cached_property
    def z(self) -> Array:
        """Standardised residuals (N, 3)."""
        return self.evidence.z if self.training is None else np.vstack([self.evidence.z, self.training.z])

    @cached_property
    def share(self) -> Array:
        """Weight (N,) of each window: m windows of a push count as m / (1 + (m - 1) r), with their correlation r."""
        return np.concatenate([_shares(e) for e in (self.evidence, self.training) if e is not None])

    @cached_property
    def scale(self) -> Array:
        """Unit of a generic effect (3,), see Effect."""
        return evidence_scale(self.evidence)

    @cached_property
    def before(self) -> Array:
        """Shift (n, 3) by the effects that the model has already."""
        return joint_shift(self.evidence.mechanics, self.evidence.effects, self.evidence.push)

    @cached_property
    def block(self) -> IntArray:
        """Number (n,) of each new window's block of pushes, from 0."""
        return np.unique(self.evidence.block, return_inverse=True)[1]

    @cached_property
    def folds(self) -> list[IntArray]:
        """The new windows of each fold."""
        return [np.flatnonzero(self.block % FOLDS == k) for k in range(min(FOLDS, int(self.block.max()) + 1))]

    def effect(self, c: Candidate, coefficients: Array | None = None) -> Effect:
        """The effect of a candidate, of size zero without coefficients."""
        size = c.size
        found = np.zeros(size) if coefficients is None else coefficients
        return Effect(c.mechanism, c.covariate, c.basis, found, np.zeros((size, size)), self.scale)

    def shift(self, effects: Sequence[Effect]) -> Array:
        """Standardised shift (n, 3) by effects in addition to those that the model has already."""
        together = joint_shift(self.evidence.mechanics, [*self.evidence.effects, *effects], self.evidence.push)
        return np.asarray(np.einsum("nij,nj->ni", self.evidence.whitener, together - self.before))

    def padded(self, values: Array) -> Array:
        """Values (n, ...) of the new windows, zero at those of training."""
        return np.concatenate([values, np.zeros((len(self.z) - len(values), *values.shape[1:]))])


@dataclass(frozen=True, eq=False)
class Weighted:
    """Weight (N,) of each window; scale (3,): standard deviation of what is left of each output."""

    rows: FitRows
    weight: Array
    scale: Array

    @classmethod
    def by_density(cls, rows: FitRows, residual: Array) -> Weighted:
        """By Student's t of residuals (N, 3)."""
        weight, scale = rows.share, np.sqrt(np.average(residual**2, axis=0, weights=rows.share))
        for _ in range(3):
            distance = np.sum((residual / scale) ** 2, axis=1)
            weight = rows.share * (DEGREES + 3.0) / (DEGREES + distance)
            scale = np.sqrt(weight @ residual**2 / rows.share.sum())
        return cls(rows, weight, scale)

    @cached_property
    def root(self) -> Array:
        """Factor (N, 3) on residuals and columns."""
        return np.asarray(np.sqrt(self.weight)[:, None] / self.scale)

    @cached_property
    def residualizer(self) -> Residualizer:
        """Removes what the controls express."""
        controls = self.rows.controls
        root = np.sqrt(self.weight)[:, None]
        return Residualizer(root * controls if controls.size else np.empty((len(root), 0)))

    def clear(self, values: Array) -> Array:
        """Values (N, 3, ...) in units of the scale, weighted, without what the controls express."""
        return self.residualizer(self.root.reshape(*self.root.shape, *[1] * (values.ndim - 2)) * values)


@dataclass(frozen=True, eq=False)
class Fit:
    """Effects fitted together.

    shift (n, 3): standardised, of the new windows. columns (N, 3, p): its derivatives by all coefficients.
    """

    rows: FitRows
    effects: tuple[Effect, ...]
    shift: Array
    columns: Array
    weighted: Weighted

    @property
    def coefficients(self) -> Array:
        """All of them (p,)."""
        return np.concatenate([np.zeros(0), *(effect.coefficients for effect in self.effects)])

    @property
    def parts(self) -> list[slice]:
        """Where each effect's coefficients stand among all."""
        ends = np.cumsum([0, *(len(effect.coefficients) for effect in self.effects)]).tolist()
        return [slice(low, high) for low, high in pairwise(ends)]

    @cached_property
    def clear_residual(self) -> Array:
        """Residuals (N, 3), see Weighted.clear."""
        return self.weighted.clear(self.rows.z - self.rows.padded(self.shift))

    @cached_property
    def clear_columns(self) -> Array:
        """Columns (N, 3, p), see Weighted.clear."""
        return self.weighted.clear(self.columns)

    @property
    def left(self) -> Array:
        """Standardised residuals (N, 3) without what the effects and the controls express."""
        return self.clear_residual / self.weighted.root

    @cached_property
    def scores(self) -> Array:
        """Log density (b,) of each block of new pushes under coefficients fitted without it, up to a constant."""
        return _held_out(self, self.clear_columns, self.coefficients)

    @cached_property
    def bend(self) -> Array:
        """Share (N,) of each window's weight that the curvature of Student's t has, on average over directions."""
        distance = np.sum(self.clear_residual**2, axis=1) / self.weighted.weight
        return np.asarray(1.0 - 2.0 / 3.0 * distance / (DEGREES + distance))

    def with_columns(self, columns: Array) -> Array:
        """The same for the fit with further linear columns (n, 3, q) of new windows, to first order."""
        both = np.concatenate([self.clear_columns, self.weighted.clear(self.rows.padded(columns))], axis=2)
        return _held_out(self, both, np.concatenate([self.coefficients, np.zeros(columns.shape[2])]))


def fitted(rows: FitRows, candidates: Sequence[Candidate], start: Sequence[Array | None] = ()) -> Fit:
    """The effects of these candidates together; start: coefficients near the solution, of those that have any."""
    begin = [*start, *[None] * (len(candidates) - len(start))]
    effects = tuple(rows.effect(c, at) for c, at in zip(candidates, begin, strict=True))
    now = _linearised(rows, effects, Weighted.by_density(rows, rows.z))
    for _ in range(MOST_STEPS):
        now = _reweighted(now)
        if not effects:
            break
        now, fall = _stepped(now)
        if fall < ENOUGH or not any(effect.exact for effect in effects):
            break
    return _reweighted(now)


def estimated(fit: Fit, *, of_size: bool = False) -> tuple[tuple[Effect, ...], Cross]:
    """The effects with their covariances, and the covariances between their coefficients (see ExtendedPredictor).

    A jackknife over blocks of pushes: it covers disturbances that neighbouring pushes share, and coefficients that
    depend on a few pushes. of_size: whether it also covers errors of the mechanics, as far as pushes of different
    angles, or at different places of the outline, disagree about a coefficient.
    """
    rows, ridge = fit.rows, _ridge(fit, fit.clear_columns)
    covariance = _jackknife(fit, _blocks(rows, rows.block), ridge)
    if of_size:
        for inputs in rows.evidence.table.inputs[:, 1:].T:  # contact, angle
            covariance = _widened(covariance, _jackknife(fit, _blocks(rows, _groups(inputs)), ridge))
    covariance *= len(rows.z) / max(len(rows.z) - fit.weighted.residualizer.q.shape[1], 1)
    parts = fit.parts
    effects = tuple(
        replace(effect, covariance=covariance[part, part]) for effect, part in zip(fit.effects, parts, strict=True)
    )
    return effects, {(i, j): covariance[parts[i], parts[j]] for i, j in combinations(range(len(parts)), 2)}


def best_place(fit: Fit, step: Candidate) -> float:
    """The place of a step, the last of the effects, where an effect of its size gains most.

    Every place between two windows is tried, and for what only grows every one between two pushes: a window's density
    with the effect less that without it counts from its covariate on.
    """
    rows, others = fit.rows, fit.effects[:-1]
    always = replace(fit.effects[-1], basis=DriverBasis("constant"))
    shifts = [rows.shift(effects) for effects in (others, (*others, always))]
    n = len(shifts[0])
    target = fit.left[:n] + fit.shift
    without, with_it = (_density((target - shift) / fit.weighted.scale) for shift in shifts)
    values = np.asarray(rows.evidence.table.covariates[step.covariate])
    group = _first_of_push(rows.evidence, values) if step.covariate in CUMULATIVE else values
    _, number = np.unique(group, return_inverse=True)
    gain = np.bincount(number, rows.share[:n] * (with_it - without))
    after = np.cumsum(gain[::-1])[::-1]  # of a step between the group before and this one
    k = 1 + int(np.argmax(after[1:]))
    return float(0.5 * (values[number < k].max() + values[number >= k].min()))


def _first_of_push(evidence: Evidence, values: Array) -> Array:
    """The smallest of the values (n,) of each window's push."""
    push = push_order(evidence.table)
    first = np.full(push.max() + 1, np.inf)
    np.minimum.at(first, push, values)
    return np.asarray(first[push])


def standard_error(gains: Array) -> float:
    """Of the sum of gains (b,) of blocks."""
    return float(np.sqrt(len(gains)) * gains.std())


# --- the fit ---------------------------------------------------------------------------------------------------------


def _linearised(rows: FitRows, effects: tuple[Effect, ...], weighted: Weighted) -> Fit:
    evidence = rows.evidence
    if not effects:
        nothing = np.zeros((len(evidence.table), 3))
        return Fit(rows, effects, nothing, np.zeros((len(rows.z), 3, 0)), weighted)
    together = joint(evidence.mechanics, (*evidence.effects, *effects), evidence.push)
    designs = np.concatenate(together.designs[len(evidence.effects) :], axis=2)
    shift = np.einsum("nij,nj->ni", evidence.whitener, together.shift - rows.before)
    columns = np.einsum("nij,njp->nip", evidence.whitener, designs)
    return Fit(rows, effects, shift, rows.padded(columns), weighted)


def _reweighted(fit: Fit) -> Fit:
    return replace(fit, weighted=Weighted.by_density(fit.rows, fit.left))


def _stepped(now: Fit) -> tuple[Fit, float]:
    """The fit after a step, lengthened or shortened, and the fall of its objective.

    Where pushes begin to stick, a step is far too short: the derivatives of the rest of the data change there, and the
    objective falls by more than promised.
    """
    ridge = _ridge(now, now.clear_columns)
    gram, slope = _normal(now.clear_columns, now.clear_residual)
    slope = slope - ridge * now.coefficients
    step = np.asarray(np.linalg.solve(gram + np.diag(ridge), slope), dtype=np.float64)
    before, best, most, length = _objective(now, ridge), now, 0.0, 1.0
    for _ in range(LENGTHS):
        tried = _moved(now, step * length)
        fall = before - _objective(tried, ridge)
        if fall > most:
            best, most = tried, fall
            if fall < LENGTHENED * length * float(step @ slope):
                break
            length *= 2.0
        elif most > 0.0:
            break
        else:
            length *= 0.5
    return best, most


def _moved(fit: Fit, step: Array) -> Fit:
    new = fit.coefficients + step
    effects = tuple(replace(e, coefficients=new[part]) for e, part in zip(fit.effects, fit.parts, strict=True))
    return _linearised(fit.rows, effects, fit.weighted)


def _objective(fit: Fit, ridge: Array) -> float:
    return 0.5 * float(np.sum(fit.clear_residual**2) + np.sum(ridge * fit.coefficients**2))


def _ridge(fit: Fit, columns: Array) -> Array:
    """For nearly collinear columns; a generic effect has normal priors of its unit besides."""
    generic = [np.full(len(e.coefficients), 0.0 if e.exact else 1.0) for e in fit.effects]
    own = np.concatenate([np.zeros(0), *generic])
    own = np.concatenate([own, np.zeros(columns.shape[2] - len(own))])
    return np.asarray(RIDGE * np.sum(columns**2, axis=(0, 1)) + own + 1e-12)


def _normal(columns: Array, residual: Array, bend: Array | None = None) -> tuple[Array, Array]:
    """Curvature (p, p) and slope (p,) of the objective; bend (n,): see Fit, 1 if None."""
    flat = columns.reshape(residual.size, columns.shape[2])
    bent = flat if bend is None else flat * np.repeat(bend, residual.shape[1])[:, None]
    return bent.T @ flat, flat.T @ residual.ravel()


def _shares(evidence: Evidence) -> Array:
    return window_weights(np.unique(evidence.table.push_id, return_inverse=True)[1])


# --- held out --------------------------------------------------------------------------------------------------------


def _held_out(fit: Fit, columns: Array, coefficients: Array) -> Array:
    """Scores (b,) of blocks: each fold's coefficients are one Gauss-Newton step from those of the fit."""
    rows, n = fit.rows, len(fit.rows.evidence.table)
    residual = fit.clear_residual[:n].copy()
    if columns.shape[2]:
        ridge = _ridge(fit, columns)
        gram, slope = _normal(columns, fit.clear_residual)
        apart = [columns[own] for own in rows.folds]
        parts = [_normal(x, residual[own]) for x, own in zip(apart, rows.folds, strict=True)]
        squares, pulls = (np.stack(each) for each in zip(*parts, strict=True))
        sides = slope - pulls - ridge * coefficients
        steps = np.linalg.solve(gram - squares + np.diag(ridge), sides[:, :, None])[:, :, 0]
        for x, own, step in zip(apart, rows.folds, steps, strict=True):
            residual[own] -= x @ step
    left = residual / fit.weighted.root[:n]
    share = rows.share[:n]
    unit = np.sqrt(np.average(left**2 * (fit.weighted.weight / rows.share)[:n, None], axis=0, weights=share))
    return sums_by(rows.block, (share * (_density(left / unit) - np.log(unit).sum()))[:, None])[:, 0]


def _density(scaled: Array) -> Array:
    """Log density (n,) of Student's t, up to a constant, of residuals (n, 3) in units of the scale."""
    return np.asarray(-0.5 * (DEGREES + 3.0) * np.log1p(np.sum(scaled**2, axis=1) / DEGREES))


# --- covariance ------------------------------------------------------------------------------------------------------


def _blocks(rows: FitRows, block: IntArray) -> IntArray:
    """Blocks (N,) with those of training behind the others."""
    if rows.training is None:
        return block
    return np.concatenate([block, block.max() + 1 + rows.training.block])


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


def _jackknife(fit: Fit, block: IntArray, ridge: Array) -> Array:
    """Covariance (p, p) of the coefficients over blocks (N,); ridge (p,): added to the columns' squares."""
    rows = [block == b for b in np.unique(block)]
    parts = [_normal(fit.clear_columns[own], fit.clear_residual[own], fit.bend[own]) for own in rows]
    squares, slopes = (np.stack(each) for each in zip(*parts, strict=True))
    square = squares.sum(axis=0) + np.diag(ridge)
    away = np.linalg.solve(square - squares, slopes[:, :, None])[:, :, 0]
    return np.asarray((1.0 - 1.0 / len(parts)) * away.T @ away)
