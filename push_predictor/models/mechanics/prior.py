# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of a prior model: draws of them, the noise of repeated pushes, and what pushes say about both.

Bauza and Rodriguez (2017, "A probabilistic data-driven model for planar pushing") find that repeated pushes of a slider
differ by some 10 to 20 % of the motion, and that the spread depends on the push, because friction varies in space and
time. So the noise is that of small changes of the friction and of the centre of pressure, passed through the mechanics.
A share of the distance travelled and the tracker's noise are added.

The update takes the most probable values of all parameters together, with the Laplace approximation of their
covariance, and the size of the noise. The windows of a push share their deviation, so each of m windows counts as
1 / (1 + (m - 1) r) with a correlation r: the information of a push with equal windows that correlate with r.

The draws are few sets of parameters, whose displacements stand for those of all plausible ones. A push depends on some
ten directions in the space of the parameters; along the others nothing that matters changes. So they are a cubature of
second degree (Stroud 1957) along the directions that change pushes all around the slider most: a simplex, the points of
which are mirrored. With any orthogonal columns the mean over the points is exact where displacements are quadratic in
the parameters, and the covariance where they are linear. Those of a random rotation also spread the squares of
deviates, which all are 1 in a two-level design: without the variance of a quadratic effect, pushes of a circle were far
too certain. Eighteen points predict standard deviations to 3 to 11 % (root mean square over pushes), thirty-two to 1 to
5 %, in almost twice the time (benchmarks/models/RESULTS.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy

from push_predictor.models.mechanics.fit import FitRows
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import COLUMN, TEXTBOOK
from push_predictor.models.mechanics.kernel.push import drawn_moments
from push_predictor.models.mechanics.parameters import BY_NAME, PARAMETERS
from push_predictor.models.pushes import Push
from push_predictor.types import Array, IntArray

CORRELATION = 0.5  # of the windows of a push; planning/persistence.py finds 0.45 and more
NOISE_WINDOWS = 6.0  # independent windows that the prior of the noise variance is worth
DIFFERENCE = 0.05  # prior standard deviations
CONVERGED = 0.02  # prior standard deviations
MOST_STEPS = 15
SHORTENINGS = 4


def updated(before: FittedMechanics, rows: FitRows) -> tuple[FittedMechanics, ProcessNoise]:
    """The parameters' posterior and the noise, from normal priors about the values with the spreads of `prior_spreads`.

    Gauss-Newton steps within the plausible ranges, each shortened until the posterior grows; the noise's factor is
    estimated again after each. Deterministic.
    """
    values, covariance, noise = _Update(before, rows).solved()
    named = dict(zip(before.values, values.tolist(), strict=True))
    return FittedMechanics(before.mechanics, named, covariance), noise


def window_weights(push: IntArray) -> Array:
    """Weight (n,) of each window by the number (n,) of its push: m windows of a push count as m / (1 + (m - 1) r)."""
    windows = np.bincount(push)[push]
    return np.asarray(1.0 / (1.0 + (windows - 1.0) * CORRELATION))


@dataclass(frozen=True, eq=False)
class _Local:
    """The model about some values: residuals (n, 3), derivatives (n, 3, p), noise (n, 3, 3) for a factor of 1."""

    residuals: Array
    jacobian: Array
    noise: Array


class _Update:
    def __init__(self, before: FittedMechanics, rows: FitRows) -> None:
        self.mechanics, self.names, self.rows = before.mechanics, tuple(before.values), rows
        self.means, (self.low, self.high) = np.array(list(before.values.values())), _ranges(before)
        self.spread = prior_spreads(self.names)
        self.weight = window_weights(rows.push)
        self.travel, self.length = rows.inputs[:, 0] * rows.duration, before.ellipsoid.length

    def solved(self) -> tuple[Array, Array, ProcessNoise]:
        """Values (p,), their covariance (p, p), and the noise."""
        values, factor = self.means, np.ones(3)
        for _ in range(MOST_STEPS):
            local = self._local(values)
            precision = self._precision(local.noise, factor)
            curvature, slope = self._equations(local, precision, values)
            stepped = self._stepped(values, np.asarray(np.linalg.solve(curvature, slope)), local.residuals, precision)
            moved, values = stepped - values, stepped
            factor = self._factor(local, local.residuals - local.jacobian @ moved, _inverse(curvature))
            if np.max(np.abs(moved) / self.spread) < CONVERGED:
                break
        local = self._local(values)
        curvature, _ = self._equations(local, self._precision(local.noise, factor), values)
        return values, _inverse(curvature), ProcessNoise(factor)

    def _local(self, values: Array) -> _Local:
        step = np.where(values + DIFFERENCE * self.spread > self.high, -DIFFERENCE, DIFFERENCE) * self.spread
        changed = ProcessNoise.changed(self.names, values)
        found = self._displacements(np.concatenate([values[None], values + np.diag(step), changed]))
        jacobian = (found[:, 1 : 1 + len(values)] - found[:, :1]).transpose(0, 2, 1) / step
        noise = ProcessNoise().covariance(found[:, 1 + len(values) :], self.travel, self.length)
        return _Local(self.rows.outcomes - found[:, 0], jacobian, noise)

    def _displacements(self, draws: Array) -> Array:
        push = Push(self.rows.inputs, self.rows.duration, self.rows.covariates)
        return self.mechanics.displaced(table_of(self.names, draws)[None], push)

    def _precision(self, noise: Array, factor: Array) -> Array:
        root = np.sqrt(factor)
        return np.asarray(np.linalg.inv(noise * root[:, None] * root) * self.weight[:, None, None])

    def _equations(self, local: _Local, precision: Array, values: Array) -> tuple[Array, Array]:
        """Curvature (p, p) and slope (p,) of the log posterior."""
        weighted = np.einsum("nkp,nkl->npl", local.jacobian, precision)
        curvature = np.einsum("npl,nlq->pq", weighted, local.jacobian) + np.diag(self.spread**-2.0)
        slope = np.einsum("npl,nl->p", weighted, local.residuals) + (self.means - values) / self.spread**2
        return curvature, slope

    def _stepped(self, values: Array, step: Array, residuals: Array, precision: Array) -> Array:
        before = self._misfit(values, residuals, precision)
        for k in range(SHORTENINGS):
            trial = np.clip(values + step * 0.4**k, self.low, self.high)
            after = self.rows.outcomes - self._displacements(trial[None])[:, 0]
            if self._misfit(trial, after, precision) < before:
                return trial
        return values

    def _misfit(self, values: Array, residuals: Array, precision: Array) -> float:
        prior = np.sum(((values - self.means) / self.spread) ** 2)
        return float(np.einsum("nk,nkl,nl->", residuals, precision, residuals) + prior)

    def _factor(self, local: _Local, residuals: Array, covariance: Array) -> Array:
        """Factor (3,) of the noise: the mean of its prior, 1, and of the residuals, weighted by windows.

        The residuals count with the uncertainty of the parameters, which a fit to these rows hides.
        """
        unsure = np.einsum("nkp,pq,nkq->nk", local.jacobian, covariance, local.jacobian)
        ratio = (residuals**2 + unsure) / np.diagonal(local.noise, axis1=1, axis2=2)
        return np.asarray((NOISE_WINDOWS + self.weight @ ratio) / (NOISE_WINDOWS + self.weight.sum()))


def _inverse(matrix: Array) -> Array:
    inverse = np.asarray(np.linalg.inv(matrix))
    return 0.5 * (inverse + inverse.T)


# Their sign changes in a mirror along the body's x axis, where the others keep theirs.
MIRRORED = (
    "friction_difference",
    "centre_y",
    "body_anisotropy_diagonal",
    "tracker_rotation",
    "push_rotation",
    "outline_y",
    "tip_offset_across",
)
# Through the speed: they matter beyond quasi-static pushing, and without them only the distance travelled counts. The
# height of a push shifts the pressure, as centre_x and centre_y do; the rim exponent spreads it.
NOT_DRAWN = ("inertia", "friction_by_speed", "clock_delay", "pushing_height", "pressure_spread")
# Of the spreads of PARAMETERS, which are weak priors for fits. Set once on 21 rigs, simulated by three simulators and
# measured in two laboratories: before the first push, 95 % intervals then cover 0.97 on average, and 0.89 on the worst.
PRIOR_SHARE = 0.7


def drawn_parameters(known_support: bool) -> tuple[str, ...]:
    """Names of the parameters that are drawn: those that need no covariate, and no patch if the support is known."""
    left_out = (*NOT_DRAWN, "rim_exponent") if known_support else NOT_DRAWN
    return tuple(p.name for p in PARAMETERS if not p.needs and p.name not in left_out)


def prior_spreads(names: Sequence[str]) -> Array:
    """Standard deviations (p,) from rig to rig of the parameters before the first push."""
    return np.array([PRIOR_SHARE * BY_NAME[name].spread for name in names])


def table_of(names: Sequence[str], draws: Array) -> Array:
    """Values (k, 28) of all parameters, from draws (k, p) of some."""
    values = np.tile(TEXTBOOK, (len(draws), 1))
    values[:, [COLUMN[name] for name in names]] = draws
    return values


VARYING = {"contact_friction": 0.1, "centre_x": 0.004, "centre_y": 0.004}  # standard deviations within a session
SHARE = 0.05  # of the distance travelled, and of the turn that moves a point at the length c that far
TRACKER = np.array([1e-4, 1e-4, 1e-3])  # m, m, rad: of the difference of two poses


@dataclass(frozen=True, eq=False)
class ProcessNoise:
    """factor (3,): on the variances of dx, dy and dtheta; 1 before there are data."""

    factor: Array = field(default_factory=lambda: np.ones(3))

    @staticmethod
    def changed(names: Sequence[str], values: Array) -> Array:
        """Rows (2 v, p) of parameters: the values (p,) with each of those that vary increased, then decreased."""
        rows = np.tile(values, (2 * len(VARYING), 1))
        for k, (name, spread) in enumerate(VARYING.items()):
            column, low, high = names.index(name), BY_NAME[name].low, BY_NAME[name].high
            above, below = min(values[column] + spread, high), max(values[column] - spread, low)
            rows[k, column], rows[len(VARYING) + k, column] = above, below
        return rows

    def covariance(self, varied: Array, travel: Array, length: float) -> Array:
        """Covariance (n, 3, 3) of the noise.

        varied (n, 2 v, 3): displacements under the parameters of `changed`. travel (n,), length c in m.
        """
        return self.moments(varied, travel, length)[2]

    def moments(self, found: Array, travel: Array, length: float) -> tuple[Array, Array, Array]:
        """Mean (n, 3) and covariance (n, 3, 3) of outcomes, and covariance (n, 3, 3) of the noise.

        found (n, 2 v + k, 3): displacements under the parameters of `changed`, then under k draws.
        """
        n = len(found)
        mean, covariance, noise = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 3, 3))
        drawn_moments(found, len(VARYING), travel, SHARE, length, TRACKER, self._factors, mean, covariance, noise)
        return mean, covariance, noise

    @cached_property
    def _factors(self) -> Array:
        """Of the covariance, (3, 3)."""
        root = np.sqrt(self.factor)
        return np.outer(root, root)


HALF = 8  # directions of either half of a design
POINTS = HALF + 1  # of a simplex in these directions
DRAWS = 2 * POINTS
_DIFFERENCE = 0.5  # standard deviations, to both sides
_CONTACTS, _ANGLES = 24, (-0.8, -0.3, 0.3, 0.8)  # rad: of the pushes that choose the directions
_SPEED, _DURATION = 0.02, 0.2  # m/s, s


def prior_draws(fitted: FittedMechanics, seed: int) -> Array:
    """Draws (DRAWS, p) from normal priors about the values with their covariance, cut off at the plausible ranges.

    The covariance is diagonal. The design has a half of mirrored parameters and one of the others, so that the mirror
    images of the draws are draws, and a symmetric outline gets symmetric predictions. Deterministic for a seed.
    """
    means, spread = np.array(list(fitted.values.values())), np.sqrt(np.diagonal(fitted.covariance))
    mirrored = np.array([name in MIRRORED for name in fitted.values])
    sensitivity = _sensitivity(fitted, np.diag(spread))
    one, other = (_directions(sensitivity, np.flatnonzero(kind), HALF) for kind in (mirrored, ~mirrored))
    design = _design(seed)
    deviates = design[:, : len(one)] @ one + design[:, HALF : HALF + len(other)] @ other
    low, high = (scipy.special.ndtr((end - means) / spread) for end in _ranges(fitted))
    return np.asarray(means + spread * scipy.special.ndtri(low + (high - low) * scipy.special.ndtr(deviates)))


def normal_draws(fitted: FittedMechanics, seed: int) -> Array:
    """Draws (DRAWS, p) about the values with their covariance, moved into the plausible ranges."""
    root = np.asarray(np.linalg.cholesky(fitted.covariance), dtype=np.float64)
    p = len(root)
    directions = _directions(_sensitivity(fitted, root), np.arange(p), 2 * HALF)
    draws = np.array(list(fitted.values.values())) + _design(seed)[:, : len(directions)] @ directions @ root.T
    return np.asarray(np.clip(draws, *_ranges(fitted)))


def _design(seed: int) -> Array:
    """Points (2 (h + 1), 2 h) of orthogonal columns, the square of each 1 on average, and the mean 0.

    Changing the sign of the first h columns gives the same points; the others are twice those of a simplex.
    """
    rng = np.random.default_rng(seed)
    signed = _orthogonal(rng.standard_normal((POINTS, POINTS)))[:, :HALF]
    simplex = _orthogonal(np.column_stack([np.ones(POINTS), rng.standard_normal((POINTS, HALF))]))[:, 1:]
    both = np.concatenate([np.hstack([sign * signed, simplex]) for sign in (1.0, -1.0)])
    return np.asarray(np.sqrt(POINTS) * both)


def _orthogonal(columns: Array) -> Array:
    """Orthogonal columns with the span of the first ones; of random columns all are equally likely (Mezzadri 2007)."""
    q, r = np.linalg.qr(columns)
    return np.asarray(q * np.sign(np.diagonal(r)))


def _sensitivity(fitted: FittedMechanics, root: Array) -> Array:
    """Sum over pushes of J' N^-1 J, (p, p): J derivatives by deviates z of values + root z, N the process noise."""
    names, values = tuple(fitted.values), np.array(list(fitted.values.values()))
    contact, angle = np.meshgrid(np.arange(_CONTACTS) / _CONTACTS, _ANGLES)
    inputs = np.column_stack([np.full(contact.size, _SPEED), contact.ravel(), angle.ravel()])
    duration = np.full(len(inputs), _DURATION)
    steps = _DIFFERENCE * root.T
    tried = np.clip(np.concatenate([values + steps, values - steps]), *_ranges(fitted))
    varied = ProcessNoise.changed(names, values)
    draws = table_of(names, np.concatenate([varied, tried]))
    found = fitted.mechanics.displaced(draws[None], Push(inputs, duration, {}))
    noise = ProcessNoise().covariance(found[:, : len(varied)], _SPEED * duration, fitted.ellipsoid.length)
    above, below = np.split(found[:, len(varied) :], 2, axis=1)
    slopes = (above - below) / (2.0 * _DIFFERENCE)  # (n, p, 3)
    return np.asarray(np.einsum("npk,nkl,nql->pq", slopes, np.linalg.inv(noise), slopes))


def _directions(sensitivity: Array, columns: IntArray, most: int) -> Array:
    """Unit vectors (at most `most`, p) within some of the parameters, those that change pushes most first."""
    _, vectors = np.linalg.eigh(sensitivity[np.ix_(columns, columns)])
    found = np.zeros((min(most, len(columns)), len(sensitivity)))
    found[:, columns] = vectors.T[::-1][: len(found)]
    largest = np.take_along_axis(found, np.argmax(np.abs(found), axis=1)[:, None], axis=1)
    return np.asarray(found * np.sign(largest))  # the sign of an eigenvector depends on the library


def _ranges(fitted: FittedMechanics) -> tuple[Array, Array]:
    table = [BY_NAME[name] for name in fitted.values]
    return np.array([p.low for p in table]), np.array([p.high for p in table])
