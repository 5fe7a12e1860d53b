# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A regression of one output, any of this folder, the one that has nothing to learn, and the choice between several.

Constant noise is a function of zero and noise that is the same everywhere:

    y = f + e,  f = 0,  e ~ N(0, exp(g)),  g ~ N(noise_mean, noise_spread^2)

With a spread above zero the noise has heavy tails, as the exact predictive of a VHGP has. It is what mechanics alone
predict, so that a learnt residual must be better than this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from push_predictor.models.gaussian_process.gp import GaussianProcess, check_rows
from push_predictor.models.gaussian_process.prediction import (
    LatentPrediction,
    density_of_constant_noise,
    exact_log_density,
)
from push_predictor.models.gaussian_process.sparse_vhgp import SparseVHGP
from push_predictor.models.gaussian_process.vhgp import VHGP
from push_predictor.types import Array, IntArray

_WIDEST = 1.5  # spread of the log noise variance, up to which the quadrature of the density is accurate
_USUAL_LOG_SPREAD, _LOG_SPREAD_SD = 0.0, 0.5  # weak prior of the spread's logarithm
_STOP = 1e-9  # relative decrease
_SMALLEST_VARIANCE = 1e-12  # of standardised outputs


@dataclass(frozen=True)
class ConstantParameters:
    """Mean and spread (standard deviation) of the log noise variance; spread 0: Gaussian noise."""

    noise_mean: float
    noise_spread: float

    @property
    def count(self) -> int:
        """Number of hyperparameters that were fitted."""
        return 1 if self.noise_spread == 0.0 else 2


class ConstantNoise:
    """The same prediction at all inputs; inputs (n, D) and outputs (n,) are the rows that it was fitted to."""

    def __init__(self, inputs: Array, outputs: Array, parameters: ConstantParameters) -> None:
        self.inputs, self.outputs, self.parameters = check_rows(inputs, outputs), outputs, parameters
        self.gaussian = parameters.noise_spread == 0.0

    @property
    def variance(self) -> float:
        """Variance of f: how well n rows determine that their mean is zero."""
        return self.noise_variance / len(self.outputs)

    @property
    def noise_variance(self) -> float:
        """Variance of the noise."""
        return float(np.exp(self.parameters.noise_mean + 0.5 * self.parameters.noise_spread**2))

    def predict(self, inputs: Array) -> LatentPrediction:
        """Predict f and the noise at inputs (m, D)."""
        numbers = 0.0, self.variance, self.parameters.noise_mean, self.parameters.noise_spread**2
        return LatentPrediction(*(np.full(len(inputs), number) for number in numbers))

    def function_covariance(self, inputs: Array) -> Array:
        """Posterior covariance (m, m) of f between inputs (m, D): one number."""
        return np.full((len(inputs), len(inputs)), self.variance)

    def held_out(self, block: IntArray) -> LatentPrediction:
        """Predict f and g at the n training rows; without a function, the rows of a block make no difference."""
        return self.predict(self.inputs)


Regression: TypeAlias = GaussianProcess | VHGP | SparseVHGP | ConstantNoise


def fit_constant(inputs: Array, outputs: Array, *, heavy_tails: bool, observed: Array | None = None) -> ConstantNoise:
    """Fit the noise by maximum likelihood: Gaussian, or with a spread (weak prior about 1) of its log variance.

    inputs (n, D) and outputs (n,), of mean about zero. observed (n,): the outputs that the noise is fitted to, where
    others than `outputs` show it better. Raises TrainingError when the rows do not match or are not finite.
    """
    check_rows(inputs, outputs)
    observed = outputs if observed is None else observed
    gaussian = float(np.log(np.mean(observed**2) + _SMALLEST_VARIANCE))
    if not heavy_tails:
        return ConstantNoise(inputs, outputs, ConstantParameters(gaussian, 0.0))
    from scipy.optimize import minimize  # its import would take every node 0.2 s at the start

    squares = np.square(observed)

    def cost(vector: Array) -> tuple[float, Array]:
        spread = float(np.exp(vector[1]))
        value, by_mean, by_spread = density_of_constant_noise(squares, float(vector[0]), spread)
        away = (vector[1] - _USUAL_LOG_SPREAD) / _LOG_SPREAD_SD
        slopes = np.array([-by_mean, away / _LOG_SPREAD_SD - spread * by_spread])
        return 0.5 * away**2 - value, slopes

    start, box = [gaussian - 0.5, _USUAL_LOG_SPREAD], [(None, None), (None, np.log(_WIDEST))]
    found = minimize(cost, start, jac=True, method="L-BFGS-B", bounds=box, options={"ftol": _STOP}).x
    return ConstantNoise(inputs, outputs, ConstantParameters(float(found[0]), float(np.exp(found[1]))))


def held_out_score(regression: Regression, block: IntArray, observed: Array | None = None) -> float:
    """Log density of the training rows when their blocks (n,) are held out, less the number of hyperparameters, nats.

    observed (n,): the outputs as they are if also their mean function is fitted without the block; by default the
    regression's. The hyperparameters are those of all rows, which makes the held-out density too good by about their
    number (Akaike 1974, for fits by maximum likelihood).
    """
    observed = regression.outputs if observed is None else observed
    return float(exact_log_density(regression.held_out(block), observed).sum()) - regression.parameters.count


def best_held_out(regressions: Sequence[Regression], block: IntArray, observed: Array | None = None) -> Regression:
    """The regression with the highest held-out score; of equal ones the first."""
    return max(regressions, key=lambda regression: held_out_score(regression, block, observed))
