# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The metrics NMSE, NLPD and coverage, the same offline and online (docs/reference/json.md).

NLPD is the negative log predictive density in SI units (m, m, rad); totals are sums over the three outputs.
"""

from __future__ import annotations

import numpy as np

from push_predictor.types import Array

COVERAGE_LEVELS = (0.5, 0.9, 0.95)


def nmse_reference(n_train: int) -> str:
    """In words, what has an NMSE of 1 for every output: without training windows there is no mean of their outcomes."""
    return "the training mean" if n_train else "predicting no motion"


def nmse(mean: Array, outcomes: Array, training_mean: Array) -> Array:
    """Squared error (k,) of predictions (n, k), divided by that of the training mean (k,)."""
    error = np.sum((outcomes - mean) ** 2, axis=0)
    spread = np.sum((outcomes - training_mean) ** 2, axis=0)
    return np.asarray(np.divide(error, spread, out=np.full(error.shape, np.nan), where=spread > 0.0))


def gaussian_nlpd(mean: Array, variance: Array, outcomes: Array) -> Array:
    """Negative log density (n, k) of outcomes under independent Gaussians, mean and variance (n, k)."""
    return np.asarray(0.5 * (np.log(2.0 * np.pi * variance) + (outcomes - mean) ** 2 / variance))


def joint_nlpd(mean: Array, covariance: Array, outcomes: Array) -> Array:
    """Negative log density (n,) of outcomes (n, k) under Gaussians with full covariance (n, k, k)."""
    z = standardised(mean, covariance, outcomes)
    log_determinant = np.linalg.slogdet(covariance)[1]
    return np.asarray(0.5 * (np.sum(z**2, axis=1) + log_determinant + z.shape[1] * np.log(2.0 * np.pi)))


def standardised(mean: Array, covariance: Array, outcomes: Array) -> Array:
    """Residuals (n, k) in units of the prediction: L^-1 (outcome - mean), L L' = covariance (n, k, k)."""
    lower = np.linalg.cholesky(covariance)
    return np.asarray(np.linalg.solve(lower, (outcomes - mean)[..., None])[..., 0])


def coverage(mean: Array, variance: Array, outcomes: Array, half_width: Array) -> Array:
    """Share (k,) of outcomes inside central intervals of half_width (k,), in predicted standard deviations."""
    return np.asarray(np.mean(np.abs(outcomes - mean) <= half_width * np.sqrt(variance), axis=0))
