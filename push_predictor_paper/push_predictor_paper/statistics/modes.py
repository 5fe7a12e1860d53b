# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The shape of the outcomes of repeated pushes: number of modes, densities of one and two Gaussians, and of a model.

Hartigan's dip (Hartigan and Hartigan 1985) is the largest difference between the distribution function of a sample and
the nearest unimodal one. It lies between 1 / (2 n) and 1 / 4. The package `diptest` computes it; p values compare it
with samples of the uniform distribution, the unimodal distribution that is hardest to distinguish from a bimodal one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from diptest import dipstat
from scipy.stats import shapiro

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.metrics import gaussian_nlpd
from push_predictor.models.gaussian_process.prediction import exact_log_density, gaussian_log_density
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.types import Array, IntArray
from push_predictor_paper.data.corpus import PushSet
from push_predictor_paper.fits.fit import Fit, trained

ROUNDING = 1e-12  # dips closer than this are equal
RESOLUTION = 50  # draws of the uniform for each test: 2 % is the least family-wise p value
FOLDS = 5
ITERATIONS = 100
NARROWEST = 0.1  # of the sample's sd: what a mode's may shrink to
FAR, POWER = 6.0, 0.8  # two equal modes so many of their sd apart should be found so often


@dataclass(frozen=True, eq=False)
class Shape:
    """The outcomes of p pushes at one time, by output (p, 3).

    dip: p values against one mode; several: family-wise, over all pushes and outputs (Holm); normal: p values against
    a Gaussian (Shapiro and Wilk). one, two: mean log density of held-out outcomes, nats, of one Gaussian and of two.
    """

    dip: Array
    several: Array
    normal: Array
    one: Array
    two: Array

    @property
    def own(self) -> Array:
        """Mean log density (p, 3) of the better of the push's own two fits."""
        return np.maximum(self.one, self.two)


def shape(outcomes: Array, sizes: IntArray) -> Shape:
    """Test the outcomes (n, 3) of p pushes, of the first of which are the first sizes[0] >= 10, and so on."""
    samples = np.split(outcomes, np.cumsum(sizes)[:-1])
    normal = np.array([[shapiro(column).pvalue for column in s.T] for s in samples])
    one, two = zip(*(held_out(s.T) for s in samples), strict=True)
    return Shape(*dip_tests(samples), normal, np.array(one), np.array(two))


def dip_tests(samples: Sequence[Array]) -> tuple[Array, Array]:
    """P values (p, 3) against one mode of p samples (r, 3): of each by itself, and family-wise over all (Holm)."""
    draws = RESOLUTION * 3 * len(samples)
    p = np.array([p_values(dip(s.T), len(s), draws) for s in samples])
    return p, holm(p.ravel()).reshape(p.shape)


def found_at(separation: float, n: int, tests: int, level: float) -> float:
    """Power to find two equal modes in n outcomes, separation in their sd, in one of `tests` tests."""
    null = uniform_dips(n, RESOLUTION * tests)
    return power(n, separation, float(np.quantile(null, 1.0 - level / tests, method="higher")))


def count_with_modes(found: int, power: float) -> Estimate:
    """The number of pushes with several modes; one that a test of too little power found may be any larger one."""
    return Estimate(float(found), float(found), float(found) if power >= POWER else np.inf)


@dataclass(frozen=True, eq=False)
class LogDensities:
    """Log densities (v, 3) of outcomes by output, SI units: moment-matched Gaussian and exact."""

    gaussian: Array
    exact: Array


def log_densities(pushes: PushSet, fit: Fit, inputs: Array, outcomes: Array) -> LogDensities:
    """Train a learned model and evaluate the densities of outcomes (v, 3) for inputs (v, 3)."""
    predictor = trained(pushes, fit).predictor
    if not isinstance(predictor, GaussianProcessPredictor):
        raise TypeError(f"{fit.kind}: only learned models have latent predictions")
    scaled, latent = predictor.scaling.outcomes(outcomes), predictor.latent(inputs)
    gaussian, exact = (
        np.column_stack([density(p, scaled[:, k]) for k, p in enumerate(latent)]) - np.log(predictor.scaling.outcome_sd)
        for density in (gaussian_log_density, exact_log_density)
    )
    return LogDensities(gaussian, exact)


def held_out(samples: Array) -> tuple[Array, Array]:
    """Mean log density (k,) of held-out values of samples (k, r), r >= 10: of one Gaussian, of a mixture of two.

    Every fifth value is held out in turn; both are fitted by maximum likelihood to the others.
    """
    k, r = samples.shape
    seen = np.arange(r) % FOLDS != np.arange(FOLDS)[:, None]
    values, weight = np.repeat(samples, FOLDS, axis=0), np.tile(seen.astype(np.float64), (k, 1))
    mean, variance = _moments(values, weight)
    one = -gaussian_nlpd(mean, variance, values)
    two = _of_two(values, weight, mean, variance)
    return _mean_held_out(one, weight, k), _mean_held_out(two, weight, k)


def _of_two(values: Array, weight: Array, mean: Array, variance: Array) -> Array:
    """Log density (b, r) of values under two Gaussians, fitted to the weighted ones by expectation maximisation."""
    shares = [(values <= mean).astype(np.float64), (values > mean).astype(np.float64)]
    logs = shares
    for _ in range(ITERATIONS):
        logs = [_log_component(values, weight, share, variance) for share in shares]
        total = np.logaddexp(*logs)
        shares = [np.exp(log - total) for log in logs]
    return np.logaddexp(*logs)


def _log_component(values: Array, weight: Array, share: Array, variance: Array) -> Array:
    mean, own = _moments(values, weight * share + 1e-12 * weight)
    part = np.sum(weight * share, axis=1, keepdims=True) / np.sum(weight, axis=1, keepdims=True)
    density = -gaussian_nlpd(mean, np.maximum(own, NARROWEST**2 * variance), values)
    return np.asarray(density + np.log(part + 1e-12))


def _moments(values: Array, weight: Array) -> tuple[Array, Array]:
    """Mean and variance (b, 1) of the rows of values (b, r)."""
    total = np.sum(weight, axis=1, keepdims=True)
    mean = np.sum(weight * values, axis=1, keepdims=True) / total
    return mean, np.sum(weight * (values - mean) ** 2, axis=1, keepdims=True) / total


def _mean_held_out(logs: Array, weight: Array, k: int) -> Array:
    out = 1.0 - weight
    return np.asarray((np.sum(logs * out, axis=1).reshape(k, FOLDS).sum(axis=1)) / out[:FOLDS].sum())


def dip(samples: Array) -> Array:
    """Dips (b,) of samples (b, n) in any order, n >= 2."""
    ordered = np.sort(samples, axis=1)
    return np.array([dipstat(sample, sort_x=False, allow_zero=False) for sample in ordered], dtype=np.float64)


def p_values(dips: Array, n: int, draws: int) -> Array:
    """P values (k,) of dips (k,) of samples of size n, by Monte Carlo with `draws` samples of the uniform distribution.

    They are at least 1 / (draws + 1).
    """
    null = uniform_dips(n, draws)
    return np.asarray((1.0 + draws - np.searchsorted(null, dips - ROUNDING)) / (draws + 1.0))


@cache
def uniform_dips(n: int, draws: int, seed: int = 0) -> Array:
    """Sorted dips (draws,) of samples of size n of the uniform distribution."""
    return np.sort(dip(np.random.default_rng([seed, n]).random((draws, n))))


def holm(p: Array) -> Array:
    """Family-wise p values (k,) of p values (k,) by Holm's (1979) step-down correction."""
    order = np.argsort(p)
    adjusted = np.maximum.accumulate((len(p) - np.arange(len(p))) * p[order])
    result = np.empty(len(p))
    result[order] = np.minimum(adjusted, 1.0)
    return result


def power(n: int, separation: float, critical: float, draws: int = 1000, seed: int = 0) -> float:
    """Share of samples of size n from two equal normal modes whose dip reaches `critical`.

    separation: distance of the modes in units of their standard deviation.
    """
    return float(np.mean(_two_mode_dips(n, separation, draws, seed) >= critical))


@cache
def _two_mode_dips(n: int, separation: float, draws: int, seed: int) -> Array:
    rng = np.random.default_rng([seed, n, round(1e3 * separation)])
    return dip(rng.standard_normal((draws, n)) + separation * rng.integers(0, 2, (draws, n)))
