# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The exact predictive density against adaptive integration and in its limits; constant noise and its fit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from push_predictor.models.gaussian_process.prediction import (
    LatentPrediction,
    density_of_constant_noise,
    exact_log_density,
    gaussian_log_density,
)
from push_predictor.models.gaussian_process.regression import fit_constant
from push_predictor.types import Array


def prediction(
    mean: float, variance: float, log_noise: float, log_noise_variance: float, m: int = 1
) -> LatentPrediction:
    return LatentPrediction(*(np.full(m, value) for value in (mean, variance, log_noise, log_noise_variance)))


def normal_density(x: float, mean: float, sd: float) -> float:
    """As scipy.stats has it, which takes a hundred times as long for a single number."""
    return float(np.exp(-0.5 * ((x - mean) / sd) ** 2) / (sd * np.sqrt(2.0 * np.pi)))


def density(at: float, of: LatentPrediction) -> float:
    return float(np.exp(exact_log_density(of, np.array([at]))[0]))


@pytest.mark.parametrize("d", [0.1, 0.5, 1.0, 1.5])
@pytest.mark.parametrize("outcome", [0.3, 1.5, 4.0])
def test_density_equals_adaptive_integration(d: float, outcome: float) -> None:
    def integrand(g: float) -> float:
        return normal_density(outcome, 0.3, np.sqrt(0.05 + np.exp(g))) * normal_density(g, -1.0, d)

    expected, _ = quad(integrand, -1 - 12 * d, -1 + 12 * d, epsabs=1e-14, epsrel=1e-12, limit=400)
    assert density(outcome, prediction(0.3, 0.05, -1.0, d**2)) == pytest.approx(expected, rel=1e-6)


def test_moments_are_those_of_the_matched_gaussian() -> None:
    of = prediction(-0.4, 0.1, -1.5, 0.6)
    moments = [quad(lambda y, k=k: y**k * density(y, of), -25, 25, limit=400, points=[-0.4])[0] for k in range(3)]
    assert moments[0] == pytest.approx(1.0, abs=1e-8)
    assert moments[1] == pytest.approx(-0.4, abs=1e-8)
    assert moments[2] - moments[1] ** 2 == pytest.approx(of.outcome_variance[0], rel=1e-6)


def test_a_known_noise_level_makes_both_densities_the_same() -> None:
    of = prediction(0.2, 0.1, -0.5, 0.0, m=9)
    outcomes = np.linspace(-3, 3, 9)
    np.testing.assert_allclose(exact_log_density(of, outcomes), gaussian_log_density(of, outcomes), atol=1e-12)


# --- noise that is the same everywhere ---


def outcomes(count: int, mean: float, spread: float) -> Array:
    rng = np.random.default_rng(0)
    return np.asarray(np.exp(0.5 * rng.normal(mean, spread, count)) * rng.standard_normal(count))


def summed(seen: Array, mean: float, spread: float) -> float:
    ones = np.ones(len(seen))
    return float(exact_log_density(LatentPrediction(0.0 * ones, 0.0 * ones, mean * ones, spread**2 * ones), seen).sum())


@pytest.mark.parametrize(("mean", "spread"), [(-1.0, 0.8), (2.0, 0.2), (0.5, 1.5)])
def test_density_and_its_derivatives(mean: float, spread: float) -> None:
    seen, step = outcomes(50, -0.5, 1.0), 1e-5
    value, by_mean, by_spread = density_of_constant_noise(seen**2, mean, spread)
    assert value == pytest.approx(summed(seen, mean, spread), rel=1e-12)
    mean_slope = (summed(seen, mean + step, spread) - summed(seen, mean - step, spread)) / (2.0 * step)
    spread_slope = (summed(seen, mean, spread + step) - summed(seen, mean, spread - step)) / (2.0 * step)
    assert by_mean == pytest.approx(mean_slope, rel=1e-6, abs=1e-6)
    assert by_spread == pytest.approx(spread_slope, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("spread", [0.3, 1.0, 3.0])
def test_fit_is_where_density_and_prior_are_highest(spread: float) -> None:
    seen = outcomes(400, -0.5, spread)
    found = fit_constant(np.zeros((400, 1)), seen, heavy_tails=True).parameters

    def score(mean: float, log_spread: float) -> float:
        return summed(seen, mean, min(float(np.exp(log_spread)), 1.5)) - 0.5 * (log_spread / 0.5) ** 2

    best = score(found.noise_mean, float(np.log(found.noise_spread)))
    for mean, log_spread in ((0.02, 0.0), (-0.02, 0.0), (0.0, 0.02), (0.0, -0.02)):
        assert score(found.noise_mean + mean, float(np.log(found.noise_spread)) + log_spread) < best
    assert found.noise_spread <= 1.5 + 1e-12
