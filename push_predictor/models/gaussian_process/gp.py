# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Standard Gaussian process regression with one noise level (Rasmussen and Williams 2006, algorithm 2.1).

Also what a VHGP shares with it: the likelihood of a process seen through independent noise, and the search for
hyperparameters by L-BFGS, on at most MOST_SEARCHED rows: more rows determine little more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from push_predictor.errors import TrainingError
from push_predictor.models.gaussian_process.inducing import InducedKernel, InducedRidge
from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.prediction import LatentPrediction, Remembered
from push_predictor.models.gaussian_process.ridge import DenseKernel, DensePosterior, DenseRidge
from push_predictor.types import Array, IntArray

# Logarithms, for inputs and outputs of unit spread.
SHORTEST = 1e-2  # lengthscale, for inputs of unit spread
_LONGEST = np.log(1e3)
_SIGNAL_BOUNDS = (np.log(1e-3), np.log(1e2))
# Open above: L-BFGS-B begins with a step of unit length only when some variable is unbounded, else far too long.
_NOISE_BOUNDS = (np.log(1e-3), np.inf)
_REFUSED = 1e10
_STOP, _ROUGH_STOP = 1e-6, 1e-4  # relative decrease
NEAR = 0.1  # of the logarithms: about the length of the first step from the minimum of some rows
_SHORT, _SURELY = np.log(0.15), 5.0  # lengthscale to begin with; advantage in nats that it must reach
_FEWEST_FOR_SHORT = 100  # rows; fewer could be interpolated by short lengthscales
_FIRST_STEPS = 3  # from each start
_MOST_ITERATIONS = 100


@dataclass(frozen=True)
class GpParameters:
    """Logarithms of the ARD lengthscales (D,), the signal's and the noise's standard deviation."""

    log_lengthscales: Array
    log_signal_sd: float
    log_noise_sd: float

    @property
    def count(self) -> int:
        """Number of hyperparameters."""
        return len(self.log_lengthscales) + 2

    @cached_property
    def kernel(self) -> ArdKernel:
        """Kernel of f."""
        return ArdKernel(self.log_lengthscales, self.log_signal_sd)

    @cached_property
    def noise_variance(self) -> float:
        """Variance of the noise."""
        return float(np.exp(2.0 * self.log_noise_sd))


class GaussianProcess:
    """A Gaussian process conditioned on inputs (n, D) and outputs (n,), both standardised by the caller."""

    gaussian = True  # predictive distribution

    def __init__(self, inputs: Array, outputs: Array, parameters: GpParameters) -> None:
        self.inputs, self.outputs, self.parameters = check_rows(inputs, outputs), outputs, parameters
        self._held_out: Remembered[LatentPrediction] = Remembered()

    @cached_property
    def posterior(self) -> DensePosterior:
        """The posterior of f: a matrix of n rows, computed at the first prediction."""
        known, weights = DenseKernel(self.parameters.kernel, self.inputs), 1.0 / self.parameters.noise_variance
        ridge = known.regularise(np.full(len(self.outputs), weights))
        known.free_matrix()
        return ridge.posterior(ridge.residual(weights * self.outputs))

    def predict(self, inputs: Array) -> LatentPrediction:
        """Predict f and the noise at inputs (m, D)."""
        mean, explained = self.posterior.predict(inputs)
        return self._prediction(mean, self.parameters.kernel.variance - explained)

    def function_covariance(self, inputs: Array) -> Array:
        """Posterior covariance (m, m) of f between inputs (m, D)."""
        return self.posterior.covariance(inputs)

    def held_out(self, block: IntArray) -> LatentPrediction:
        """Predict f and g at the n training rows, each from the rows of all other blocks (n,), without a new fit."""
        return self._held_out.of(lambda: self._predicted_without(block), block)

    def _predicted_without(self, block: IntArray) -> LatentPrediction:
        errors, variance = self.posterior.ridge.held_out_errors(self.posterior.weights, block)
        return self._prediction(self.outputs - errors, variance - self.parameters.noise_variance)

    def _prediction(self, mean: Array, variance: Array) -> LatentPrediction:
        # The noise bounds the posterior variance from below by about noise / n; rounding may not.
        variance = np.maximum(variance, np.finfo(float).eps * self.parameters.kernel.variance)
        log_noise = np.full(len(mean), 2.0 * self.parameters.log_noise_sd)
        return LatentPrediction(mean, variance, log_noise, np.zeros(len(mean)))


def fit_gp(inputs: Array, outputs: Array, *, shortest: float = SHORTEST, rough: bool = False) -> GaussianProcess:
    """Maximise the marginal likelihood over the hyperparameters by L-BFGS.

    inputs (n, D) and outputs (n,) standardised. shortest: lengthscale. rough: whether the search ends early, with the
    hyperparameters of MOST_SEARCHED rows, for fits that are compared, or that another begins from. Raises
    TrainingError when the rows do not match or are not finite.
    """
    check_rows(inputs, outputs)
    box = np.array([(np.log(shortest), _LONGEST)] * inputs.shape[1] + [_SIGNAL_BOUNDS, _NOISE_BOUNDS])
    rows, whole = some_rows(len(outputs), MOST_SEARCHED), Descent(box, _MOST_ITERATIONS, _STOP)
    few = replace(whole, stop=_ROUGH_STOP) if rough or len(rows) < len(outputs) else whole
    cost = _cost(inputs[rows], outputs[rows])
    found = few.run(cost, _start(cost, inputs[rows].shape, few))
    if not rough and len(rows) < len(outputs):
        found = whole.run(_cost(inputs, outputs), found.point, NEAR)
    return GaussianProcess(inputs, outputs, _parameters(found.point))


def _start(cost: Cost, shape: tuple[int, ...], descent: Descent) -> Array:
    """Where to begin: unit lengthscales, or where the first steps from one short lengthscale lead, if clearly better.

    On a polygon the outcome jumps from side to side. From a long lengthscale the search may take the jumps for noise.
    """
    n, d = shape
    usual = np.append(np.zeros(d + 1), np.log(0.3))
    if n < _FEWEST_FOR_SHORT or descent.box[0, 0] > _SHORT:
        return usual
    brief = replace(descent, most_iterations=_FIRST_STEPS)
    reached = [brief.run(cost, usual + short) for short in _SHORT * np.eye(d + 1, d + 2, -1)]
    best = min(reached, key=lambda minimum: minimum.cost)
    return (best if best.cost < reached[0].cost - _SURELY else reached[0]).point


def log_likelihood_and_gradient(inputs: Array, outputs: Array, parameters: GpParameters) -> tuple[float, Array]:
    """Log p(outputs | inputs) and its derivative wrt (log lengthscales, log signal sd, log noise sd), (D + 2,).

    Raises LinAlgError where the kernel matrix plus noise is not positive definite.
    """
    noise = parameters.noise_variance
    likelihood = Likelihood.of(DenseKernel(parameters.kernel, inputs), outputs, np.full(len(outputs), noise))
    return likelihood.value, np.append(likelihood.gradient(), 2.0 * noise * likelihood.slopes.sum())


def check_rows(inputs: Array, outputs: Array) -> Array:
    """The inputs, if they are (n, D) finite numbers that match outputs (n,). Raises TrainingError otherwise."""
    if inputs.ndim != 2 or outputs.shape != inputs.shape[:1] or len(outputs) < 2:
        raise TrainingError(
            f"inputs have shape {inputs.shape} and outputs {outputs.shape}, give (n, D) and (n,) with n >= 2"
        )
    if not (np.isfinite(inputs).all() and np.isfinite(outputs).all()):
        raise TrainingError("inputs or outputs contain NaN or infinity, give finite numbers")
    return inputs


def _parameters(vector: Array) -> GpParameters:
    return GpParameters(vector[:-2], float(vector[-2]), float(vector[-1]))


def _cost(inputs: Array, outputs: Array) -> Cost:
    def negative_log_likelihood(vector: Array) -> tuple[float, Array]:
        try:
            value, gradient = log_likelihood_and_gradient(inputs, outputs, _parameters(vector))
        except np.linalg.LinAlgError:
            return _REFUSED, np.zeros_like(vector)
        return -value, -gradient

    return negative_log_likelihood


Kernel: TypeAlias = DenseKernel | InducedKernel
Ridge: TypeAlias = DenseRidge | InducedRidge


@dataclass(frozen=True, eq=False)
class Likelihood:
    """log N(y | 0, K + D) - 1/2 sum_i unexplained_i / D_i, and its derivatives."""

    kernel: Kernel
    ridge: Ridge
    alpha: Array  # (K + D)^-1 y
    value: float

    @classmethod
    def of(cls, kernel: Kernel, outputs: Array, noise: Array) -> Likelihood:
        """For outputs y (n,) and noise variances D (n,). Raises LinAlgError."""
        weights = 1.0 / noise
        ridge = kernel.regularise(weights)
        alpha = ridge.residual(weights * outputs)
        fit = outputs @ alpha + ridge.log_determinant + np.log(2.0 * np.pi * noise).sum()
        return cls(kernel, ridge, alpha, -0.5 * float(fit + (weights * kernel.unexplained).sum()))

    @cached_property
    def slopes(self) -> Array:
        """Derivative of the value by D, shape (n,)."""
        weights, uncertainty = self.ridge.weights, self.ridge.posterior_diagonal + self.kernel.unexplained
        return np.asarray(0.5 * (self.alpha**2 - weights + uncertainty * weights**2))

    def gradient(self) -> Array:
        """Derivative of the value by (log_lengthscales, log_sd) of the kernel at fixed D, shape (D + 1,)."""
        return self.ridge.gradient(self.alpha)


Cost = Callable[[Array], tuple[float, Array]]

MOST_SEARCHED = 350


@dataclass(frozen=True)
class Minimum:
    """A minimum of a cost: point (D,)."""

    point: Array
    cost: float


@dataclass(frozen=True)
class Descent:
    """A bounded minimisation: box (D, 2) of the variables, most iterations, relative decrease at which it ends."""

    box: Array
    most_iterations: int
    stop: float

    def run(self, cost: Cost, first: Array, unit: float = 1.0) -> Minimum:
        """The local minimum reached from a point of the box; unit: about the length of the first step."""
        from scipy.optimize import minimize  # its import would take every node 0.2 s at the start

        def scaled(point: Array) -> tuple[float, Array]:
            value, gradient = cost(point * unit)
            return value, gradient * unit

        options = {"maxiter": self.most_iterations, "ftol": self.stop}
        found = minimize(scaled, first / unit, jac=True, method="L-BFGS-B", bounds=self.box / unit, options=options)
        return Minimum(found.x * unit, float(found.fun))


def some_rows(n: int, most: int) -> IntArray:
    """Indices of at most this many of n rows, at random, but always the same."""
    return np.sort(np.random.default_rng(0).permutation(n)[:most])
