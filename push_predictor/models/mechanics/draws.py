# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The draws of a prior model: few sets of parameters, whose displacements stand for those of all plausible ones.

A push depends on some ten directions in the space of the parameters; along the others nothing that matters changes. So
the draws are a cubature of second degree (Stroud 1957) along the directions that change pushes all around the slider
most: a simplex, the points of which are mirrored. With any orthogonal columns the mean over the points is exact where
displacements are quadratic in the parameters, and the covariance where they are linear. Those of a random rotation also
spread the squares of deviates, which all are 1 in a two-level design: without the variance of a quadratic effect,
pushes of a circle were far too certain. Eighteen points predict standard deviations to 3 to 11 % (root mean square over
pushes), thirty-two to 1 to 5 %, in almost twice the time (docs/results/prior.md).
"""

from __future__ import annotations

import numpy as np
import scipy

from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.prior import MIRRORED, ProcessNoise, table_of
from push_predictor.models.pushes import Push
from push_predictor.types import Array, IntArray

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
