# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The prediction of one output at m inputs, before noise and function are combined, the densities of an outcome, and
results that are remembered.

The exact predictive of a VHGP, int N(y | a, c^2 + e^g) N(g | b, d^2) dg (Lazaro-Gredilla and Titsias 2011,
section 3.3), is not Gaussian. The integral is done by Gauss-Hermite quadrature.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from push_predictor.types import Array

_NODES, _NODE_WEIGHTS = np.polynomial.hermite_e.hermegauss(100)
# With a hundred nodes the density is accurate to 1e-6 up to a standard deviation of g of 1.5.
_LOG_WEIGHTS = np.log(_NODE_WEIGHTS) - 0.5 * np.log(2.0 * np.pi)


@dataclass(frozen=True)
class LatentPrediction:
    """f ~ N(mean, variance) and the log noise variance g ~ N(log_noise_mean, log_noise_variance).

    Each (m,), or (m, 3) for three outputs together. The outcome is y ~ N(f, exp(g)). A homoscedastic process has a
    log_noise_variance of 0.
    """

    mean: Array
    variance: Array
    log_noise_mean: Array
    log_noise_variance: Array

    @property
    def process_variance(self) -> Array:
        """E[exp(g)], the variance of the process itself."""
        return np.asarray(np.exp(self.log_noise_mean + 0.5 * self.log_noise_variance))

    @property
    def outcome_variance(self) -> Array:
        """Variance of an observed outcome: of the process plus that of f, (m,)."""
        return self.variance + self.process_variance


def exact_log_density(prediction: LatentPrediction, outcomes: Array) -> Array:
    """Log p(outcomes) under the exact predictive, outcomes (m,), shape (m,)."""
    variances = _variances_at_nodes(prediction)
    return np.asarray(
        scipy.special.logsumexp(
            _log_normal(outcomes[:, None], prediction.mean[:, None], variances) + _LOG_WEIGHTS, axis=1
        )
    )


def density_of_constant_noise(squares: Array, noise_mean: float, noise_spread: float) -> tuple[float, float, float]:
    """Sum of log p(y) over outcomes of squares y^2 (m,), f = 0 and g ~ N(noise_mean, noise_spread^2) everywhere.

    Also its derivatives by noise_mean and noise_spread.
    """
    halves = 0.5 * squares[:, None] * np.exp(-noise_mean - noise_spread * _NODES)  # y^2 / 2 v at each node, (m, nodes)
    logs = _LOG_WEIGHTS - 0.5 * (np.log(2.0 * np.pi) + noise_mean + noise_spread * _NODES) - halves
    highest = logs.max(axis=1, keepdims=True)
    shares = np.exp(logs - highest)
    sums = shares.sum(axis=1)
    slopes = ((shares * (halves - 0.5)).T @ (1.0 / sums)).T  # by the log variance at each node
    value = float((np.log(sums) + highest[:, 0]).sum())
    return value, float(slopes.sum()), float(slopes @ _NODES)


def gaussian_log_density(prediction: LatentPrediction, outcomes: Array) -> Array:
    """Log N(outcomes | mean, outcome_variance), the Gaussian of the same mean and variance, shape (m,)."""
    return _log_normal(outcomes, prediction.mean, prediction.outcome_variance)


def _variances_at_nodes(prediction: LatentPrediction) -> Array:
    spread = np.sqrt(prediction.log_noise_variance)[:, None] * _NODES
    return np.asarray(prediction.variance[:, None] + np.exp(prediction.log_noise_mean[:, None] + spread))


def _log_normal(values: Array, mean: Array, variance: Array) -> Array:
    return np.asarray(-0.5 * (np.log(2.0 * np.pi * variance) + (values - mean) ** 2 / variance))


Found = TypeVar("Found")
MOST_REMEMBERED, MOST_ROWS = 4, 50_000  # results, and rows of one: a batch of a million would take 100 MB


class Remembered(Generic[Found]):
    """The last few results of several rows: moments, densities, correlation and tails of the same rows share them.

    `functools.lru_cache` takes no arrays.
    """

    def __init__(self) -> None:
        self._known: dict[bytes, Found] = {}

    def of(self, compute: Callable[[], Found], *given: NDArray[Any]) -> Found:
        """The result for these arrays, computed if it is not known. It must not be changed."""
        if not 1 < len(given[0]) <= MOST_ROWS:
            return compute()
        key = b"".join(each.tobytes() for each in given)
        if (known := self._known.get(key)) is None:
            known = compute()
            self._known = dict([*self._known.items(), (key, known)][-MOST_REMEMBERED:])
        return known
