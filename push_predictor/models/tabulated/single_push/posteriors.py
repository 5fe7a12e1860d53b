# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A learnt model's prediction of one push without its table, several times as fast as with its dense factors.

Kernels of all outputs are evaluated as one array. The mean is exact. The explained variance takes a low-rank factor
(grid_posterior), which neglects prior variance far below the noise. What needs no more is computed in single precision.
`SinglePosteriors` is compared with the model outside its domain, and used there only if it is accurate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, log, sqrt
from typing import Any, NamedTuple

import numpy as np

from push_predictor.models.features import push_features
from push_predictor.models.gaussian_process.constant import ConstantNoise
from push_predictor.models.gaussian_process.kernels import SquaredExponential
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.predictors.correlation import Correlation
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.grid_posterior import GridPosterior, GridRegression
from push_predictor.models.tabulated.prediction_table import on_grid
from push_predictor.models.tabulated.single_push.moments import moments_in_numbers
from push_predictor.models.tabulated.table_accuracy import Probes, TableAccuracy, compared_with, probed_outside
from push_predictor.types import Array, IntArray

NEGLIGIBLE = 2e-4  # of the smallest noise variance: prior variance of f that is neglected
NEGLIGIBLE_IN_NOISE = 5e-3  # the same of a log noise variance
FAR_ABOVE_NOISE = 1e3  # prior variance over noise variance from which on single precision is too coarse
SINGLE: np.dtype[Any] = np.dtype(np.float32)
DOUBLE: np.dtype[Any] = np.dtype(np.float64)
CHECKED = 100  # pushes outside the domain


@dataclass(frozen=True, eq=False)
class SinglePosterior:
    """The posterior of one function: mean and variance from correlations with its inputs.

    inverse (D,): 1 / (2^1/2 lengthscale); inputs (n, D); weights (n,): of the correlations, for the mean. pivots (r,):
    inputs whose correlations, times the factor (s, r), have the explained variance as squared norm. prior: variance
    far from all inputs; least: what the variance cannot fall below.
    """

    inverse: Array
    inputs: Array
    weights: Array
    pivots: IntArray
    factor: Array
    prior: float
    least: float


@dataclass(frozen=True, eq=False)
class SingleRegression:
    """The posterior of an output. log_noise: log noise variance, or its prior mean if `noise` is added to it."""

    log_noise: float
    signal: SinglePosterior
    noise: SinglePosterior | None


class SinglePosteriors:
    """Three regressions and their correlation at one push at a time."""

    def __init__(
        self, predictor: GaussianProcessPredictor, regressions: Sequence[SingleRegression | ConstantNoise]
    ) -> None:
        scaling, correlation = predictor.scaling, predictor.correlation
        self._columns = list(scaling.columns)
        self._centre, self._per_unit = scaling.feature_mean, 1.0 / scaling.feature_sd
        self._units = list(
            zip(
                scaling.outcome_mean.tolist(),
                scaling.outcome_sd.tolist(),
                (predictor.reported_sd**2).tolist(),
                strict=True,
            )
        )
        self.regressions = regressions
        learnt = [regression for regression in regressions if isinstance(regression, SingleRegression)]
        self._signals = _Stack.of([r.signal for r in learnt], DOUBLE)
        self._noises = _Stack.of([r.noise for r in learnt if r.noise], SINGLE)
        self._coupling = None if correlation is None else _Coupling(correlation)

    def moments(self, features: Sequence[float]) -> list[float]:
        """Mean (3), outcome and process covariance (9 each), SI units, of a push with these features (F,)."""
        x = (np.array([features[column] for column in self._columns]) - self._centre) * self._per_unit
        signals, noises = iter(self._signals.at(x)), iter(self._noises.at(x))
        mean, latent, process = [], [], []
        for regression, (middle, sd, square) in zip(self.regressions, self._units, strict=True):
            if isinstance(regression, ConstantNoise):
                value, variance, log_noise = 0.0, regression.variance, log(regression.noise_variance)
            else:
                (value, variance), log_noise = next(signals), regression.log_noise
                if regression.noise is not None:
                    log_mean, spread = next(noises)
                    log_noise += log_mean + 0.5 * spread
            mean.append(value * sd + middle)
            latent.append(variance * square)
            process.append(exp(log_noise) * square)
        return moments_in_numbers(mean, latent, process, None if self._coupling is None else self._coupling.at(x))


def single_posteriors(model: PushModel) -> SinglePosteriors | None:
    """Those of a learnt model without a mean, None if they are not accurate outside its domain."""
    predictor = model.predictor
    if not isinstance(predictor, GaussianProcessPredictor):
        return None
    regressions = [on_grid(regression) for regression in predictor.regressions]
    if not all(_of_low_rank(regression) for regression in regressions):
        return None
    found = SinglePosteriors(predictor, [_single(regression) for regression in regressions])
    return found if accuracy_of(found, model).accepted else None


def accuracy_of(posteriors: SinglePosteriors, model: PushModel, count: int = CHECKED) -> TableAccuracy:
    """The largest differences from a model, at pushes outside its domain."""
    return error_at(posteriors, model, probed_outside(model, count))


def error_at(posteriors: SinglePosteriors, model: PushModel, exact: Probes) -> TableAccuracy:
    """The largest differences from what the model itself predicts."""
    features = push_features(model.rig.outline, exact.inputs).tolist()
    numbers = np.array([posteriors.moments(row) for row in features])
    covariance, process_covariance = numbers[:, 3:].reshape(-1, 2, 3, 3).transpose(1, 0, 2, 3)
    return compared_with(exact, numbers[:, :3], covariance, process_covariance)


def _of_low_rank(regression: GridRegression | ConstantNoise) -> bool:
    """Whether the matrices of an output's kernel are of low rank."""
    return isinstance(regression, ConstantNoise) or isinstance(regression.signal.kernel, SquaredExponential)


def _single(regression: GridRegression | ConstantNoise) -> SingleRegression | ConstantNoise:
    if isinstance(regression, ConstantNoise):
        return regression
    noise = None if regression.noise is None else _reduced(regression.noise, NEGLIGIBLE_IN_NOISE)
    return SingleRegression(regression.log_noise, _reduced(regression.signal, NEGLIGIBLE), noise)


def _reduced(posterior: GridPosterior, negligible: float) -> SinglePosterior:
    """The posterior with a factor of low rank."""
    pivots, root = posterior.explaining(negligible)
    fine = posterior.prior_variance > FAR_ABOVE_NOISE * float(posterior.noise_variances.min())
    return SinglePosterior(
        np.exp(-posterior.kernel.log_lengthscales) * sqrt(0.5),
        posterior.inputs,
        posterior.kernel.variance * posterior.weights,
        pivots,
        np.ascontiguousarray(root.T, dtype=DOUBLE if fine else SINGLE),
        posterior.prior_variance,
        posterior.least_variance,
    )


class _Part(NamedTuple):
    """One posterior of a stack: where its inputs are, and its weights in the stack's precision."""

    inputs: slice
    weights: Array
    of: SinglePosterior


@dataclass(frozen=True, eq=False)
class _Stack:
    """Posteriors that are evaluated together.

    scale, inputs (D, N): inverse lengthscales of each input's kernel, over 2^1/2, and scaled inputs, of all posteriors.
    """

    scale: Array
    inputs: Array
    parts: list[_Part]

    @classmethod
    def of(cls, posteriors: Sequence[SinglePosterior], precision: np.dtype[Any]) -> _Stack:
        """The posteriors of functions, with numbers of this precision."""
        scales, inputs, parts, start = [], [], [], 0
        for posterior in posteriors:
            inverse = posterior.inverse[:, None]
            scales.append(np.repeat(inverse, len(posterior.inputs), axis=1))
            inputs.append(posterior.inputs.T * inverse)
            part = slice(start, start := start + len(posterior.inputs))
            parts.append(_Part(part, posterior.weights.astype(precision), posterior))
        if not parts:
            return cls(np.empty((0, 0)), np.empty((0, 0)), [])
        scale, together = (np.concatenate(arrays, axis=1).astype(precision) for arrays in (scales, inputs))
        return cls(scale, together, parts)

    def at(self, x: Array) -> list[tuple[float, float]]:
        """Mean and variance of each function at standardised features (D,)."""
        if not self.parts:
            return []
        apart = self.scale * x.astype(self.scale.dtype)[:, None]
        apart -= self.inputs
        apart *= apart
        kernel = apart.sum(axis=0)
        np.exp(np.negative(kernel, out=kernel), out=kernel)
        found = []
        for part in self.parts:
            row, of = kernel[part.inputs], part.of
            half = of.factor @ row[of.pivots].astype(of.factor.dtype)
            found.append((float(part.weights @ row), max(of.prior - float(half @ half), of.least)))
        return found


class _Coupling:
    """The correlation of the outputs at one push."""

    def __init__(self, correlation: Correlation) -> None:
        self._inputs = np.ascontiguousarray(correlation.features.T, dtype=SINGLE)
        self._products = np.ascontiguousarray(correlation.products.T, dtype=SINGLE)
        self._factor, self._shrinkage = -0.5 / correlation.bandwidth**2, correlation.shrinkage

    def at(self, x: Array) -> tuple[float, float, float]:
        """The correlations of dx and dy, dx and dtheta, dy and dtheta; see Correlation.at."""
        apart = self._inputs - x.astype(SINGLE)[:, None]
        apart *= apart
        exponents = apart.sum(axis=0)
        exponents *= SINGLE.type(self._factor)
        a, b, c, ab, ac, bc = (self._products @ np.exp(exponents, out=exponents)).tolist()
        a, b, c = a + self._shrinkage, b + self._shrinkage, c + self._shrinkage
        return ab / sqrt(a * b), ac / sqrt(a * c), bc / sqrt(b * c)
