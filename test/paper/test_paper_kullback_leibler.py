# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""KL of Gaussians against numerical integration of its definition; the printed formula against the paper's text."""

from __future__ import annotations

import numpy as np
import pytest
from push_predictor_paper.statistics.divergence import expected_kl, gaussian_kl, kl_of_mean, printed_kl
from scipy.integrate import quad

ZERO, ONE = np.zeros(1), np.ones(1)


def log_density(y: float, mean: float, sd: float) -> float:
    return -0.5 * ((y - mean) / sd) ** 2 - np.log(sd) - 0.5 * np.log(2.0 * np.pi)


def kl_by_integration(mean: float, sd: float, model_mean: float, model_sd: float) -> float:
    def integrand(y: float) -> float:
        log_p = log_density(y, mean, sd)
        return float(np.exp(log_p) * (log_p - log_density(y, model_mean, model_sd)))

    ends = mean + sd * np.arange(-14, 15)
    return sum(quad(integrand, end, end + sd, epsabs=1e-14, epsrel=1e-13)[0] for end in ends[:-1])


@pytest.mark.parametrize(
    "case", [(0.0, 1.0, 0.0, 1.0), (0.3, 0.5, -0.2, 1.7), (1.0, 2.0, 0.5, 0.9), (0.0, 1.0, 3.0, 1.0)]
)
def test_kl_equals_the_integral_of_its_definition(case: tuple[float, float, float, float]) -> None:
    closed = float(gaussian_kl(*(np.array(v) for v in case)))
    assert closed == pytest.approx(kl_by_integration(*case), rel=1e-12, abs=1e-12)


def test_kl_is_zero_for_equal_gaussians_and_positive_otherwise() -> None:
    rng = np.random.default_rng(0)
    mean, sd, other, other_sd = (
        rng.normal(size=99),
        rng.gamma(2.0, size=99),
        rng.normal(size=99),
        rng.gamma(2.0, size=99),
    )
    np.testing.assert_array_equal(gaussian_kl(mean, sd, mean, sd), np.zeros(99))
    assert (gaussian_kl(mean, sd, other, other_sd) > 0.0).all()


def test_kl_is_independent_of_units() -> None:
    values = [np.array(v) for v in (0.3, 0.5, -0.2, 1.7)]
    assert gaussian_kl(*(1e3 * v for v in values)) == pytest.approx(float(gaussian_kl(*values)), rel=1e-13)


def test_kl_of_means_equals_kl_with_equal_deviations() -> None:
    assert kl_of_mean(ZERO, 2.0 * ONE, ONE) == pytest.approx(float(gaussian_kl(ZERO, ONE, 2.0 * ONE, ONE)[0]))


def test_printed_formula_is_that_of_the_paper_and_not_a_divergence() -> None:
    mean, sd, model_mean, model_sd = 0.3, 0.5, -0.2, 1.7
    paper = 0.5 * (np.log(model_sd / sd) + (sd**2 + (mean - model_mean) ** 2) / model_sd**2 - 1.0)
    assert printed_kl(*(np.array(v) for v in (mean, sd, model_mean, model_sd))) == pytest.approx(paper, abs=1e-15)
    lowest = printed_kl(ZERO, ONE, ZERO, np.sqrt(2.0) * ONE)[0]
    assert lowest == pytest.approx(-0.0767, abs=1e-4)


@pytest.mark.parametrize("n", [10, 100])
def test_expected_kl_of_the_true_distribution(n: int) -> None:
    draws = np.random.default_rng(n).standard_normal((40_000, n))
    kl = gaussian_kl(draws.mean(axis=1), draws.std(axis=1, ddof=1), ZERO, ONE)
    assert kl.mean() == pytest.approx(expected_kl(n), abs=4.0 * kl.std() / 200.0)


def test_expected_kl_between_two_halves_of_a_sample() -> None:
    one, two = np.random.default_rng(1).standard_normal((2, 40_000, 25))
    moments = [each for half in (one, two) for each in (half.mean(axis=1), half.std(axis=1, ddof=1))]
    kl = gaussian_kl(*moments)
    assert kl.mean() == pytest.approx(expected_kl(25, 25), abs=4.0 * kl.std() / 200.0)
    assert expected_kl(25, 25) > 2.0 * expected_kl(25)
