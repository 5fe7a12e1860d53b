# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Noise that is the same everywhere: its density and its fit."""

from __future__ import annotations

import numpy as np
import pytest

from push_predictor.models.gaussian_process.prediction import (
    LatentPrediction,
    density_of_constant_noise,
    exact_log_density,
)
from push_predictor.models.gaussian_process.regression import fit_constant
from push_predictor.types import Array


def outcomes(count: int, mean: float, spread: float) -> Array:
    rng = np.random.default_rng(0)
    return np.asarray(np.exp(0.5 * rng.normal(mean, spread, count)) * rng.standard_normal(count))


def density(seen: Array, mean: float, spread: float) -> float:
    ones = np.ones(len(seen))
    return float(exact_log_density(LatentPrediction(0.0 * ones, 0.0 * ones, mean * ones, spread**2 * ones), seen).sum())


@pytest.mark.parametrize(("mean", "spread"), [(-1.0, 0.8), (2.0, 0.2), (0.5, 1.5)])
def test_density_and_its_derivatives(mean: float, spread: float) -> None:
    seen, step = outcomes(50, -0.5, 1.0), 1e-5
    value, by_mean, by_spread = density_of_constant_noise(seen**2, mean, spread)
    assert value == pytest.approx(density(seen, mean, spread), rel=1e-12)
    mean_slope = (density(seen, mean + step, spread) - density(seen, mean - step, spread)) / (2.0 * step)
    spread_slope = (density(seen, mean, spread + step) - density(seen, mean, spread - step)) / (2.0 * step)
    assert by_mean == pytest.approx(mean_slope, rel=1e-6, abs=1e-6)
    assert by_spread == pytest.approx(spread_slope, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("spread", [0.3, 1.0, 3.0])
def test_fit_is_where_density_and_prior_are_highest(spread: float) -> None:
    seen = outcomes(400, -0.5, spread)
    found = fit_constant(np.zeros((400, 1)), seen, heavy_tails=True).parameters

    def score(mean: float, log_spread: float) -> float:
        return density(seen, mean, min(float(np.exp(log_spread)), 1.5)) - 0.5 * (log_spread / 0.5) ** 2

    best = score(found.noise_mean, float(np.log(found.noise_spread)))
    for mean, log_spread in ((0.02, 0.0), (-0.02, 0.0), (0.0, 0.02), (0.0, -0.02)):
        assert score(found.noise_mean + mean, float(np.log(found.noise_spread)) + log_spread) < best
    assert found.noise_spread <= 1.5 + 1e-12
