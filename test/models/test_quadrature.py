# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The exact predictive density of a VHGP against adaptive integration and in its limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from push_predictor.models.gaussian_process.prediction import LatentPrediction, exact_log_density, gaussian_log_density


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
