# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Standard Gaussian process regression with one noise level (Rasmussen and Williams 2006, algorithm 2.1)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.errors import TrainingError
from push_predictor.models.gaussian_process.descent import Cost, Descent, Minimum, part_of_rows
from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.posterior import KernelPosterior, Likelihood
from push_predictor.models.gaussian_process.prediction import LatentPrediction, Remembered
from push_predictor.models.gaussian_process.ridge import DenseKernel
from push_predictor.types import Array, IntArray

# Logarithms, for inputs and outputs of unit spread.
SHORTEST = 1e-2  # lengthscale, for inputs of unit spread
_LONGEST = np.log(1e3)
_SIGNAL_BOUNDS = (np.log(1e-3), np.log(1e2))
# Open above: L-BFGS-B begins with a step of unit length only when some variable is unbounded, else far too long.
_NOISE_BOUNDS = (np.log(1e-3), np.inf)
_REFUSED = 1e10
STOP, ROUGH_STOP = 1e-6, 1e-4  # relative decrease; rough: of fits that are compared, or that another begins from
_SHORT, _SURELY = np.log(0.15), 5.0  # lengthscale to begin with; advantage in nats that it must reach
_FEWEST_TO_BEGIN_FROM = 300  # rows of a part; the likelihood of fewer often has its highest maximum elsewhere
_FEWEST_FOR_SHORT = 100  # rows; fewer could be interpolated by short lengthscales


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

    @property
    def kernel(self) -> ArdKernel:
        """Kernel of f."""
        return ArdKernel(self.log_lengthscales, self.log_signal_sd)

    @property
    def noise_variance(self) -> float:
        """Variance of the noise."""
        return float(np.exp(2.0 * self.log_noise_sd))


class GaussianProcess:
    """A Gaussian process conditioned on inputs (n, D) and outputs (n,), both standardised by the caller."""

    gaussian = True  # predictive distribution

    def __init__(self, inputs: Array, outputs: Array, parameters: GpParameters) -> None:
        self.inputs, self.outputs, self.parameters = check_rows(inputs, outputs), outputs, parameters
        noise = np.full(len(outputs), parameters.noise_variance)
        self._posterior = KernelPosterior(parameters.kernel.matrix(inputs), noise)
        self._weights = self._posterior.weights(outputs)
        self._held_out = Remembered(self._predicted_without)

    def predict(self, inputs: Array) -> LatentPrediction:
        """Predict f and the noise at inputs (m, D)."""
        kernel = self.parameters.kernel
        cross = kernel.cross(inputs, self.inputs)
        # The noise bounds the posterior variance from below by about noise / n; rounding may not.
        smallest = np.finfo(float).eps * kernel.variance
        variance = np.maximum(kernel.variance - self._posterior.explained_variance(cross), smallest)
        log_noise = np.full(len(cross), 2.0 * self.parameters.log_noise_sd)
        return LatentPrediction(cross @ self._weights, variance, log_noise, np.zeros(len(cross)))

    def function_covariance(self, inputs: Array) -> Array:
        """Posterior covariance (m, m) of f between inputs (m, D)."""
        kernel = self.parameters.kernel
        return kernel.matrix(inputs) - self._posterior.explained_covariance(kernel.cross(inputs, self.inputs))

    def held_out(self, block: IntArray) -> LatentPrediction:
        """Predict f and g at the n training rows, each from the rows of all other blocks (n,), without a new fit."""
        return self._held_out.of(block)

    def _predicted_without(self, block: IntArray) -> LatentPrediction:
        kernel, noise = self.parameters.kernel, np.full(len(self.outputs), self.parameters.noise_variance)
        likelihood = Likelihood.of(DenseKernel.of(kernel, self.inputs), self.outputs, noise)
        errors, variance = likelihood.ridge.held_out_errors(likelihood.alpha, block)
        variance = np.maximum(variance - noise, np.finfo(float).eps * kernel.variance)
        return LatentPrediction(self.outputs - errors, variance, np.log(noise), np.zeros(len(noise)))


def fit_gp(
    inputs: Array, outputs: Array, *, most_iterations: int = 100, shortest: float = SHORTEST, stop: float = STOP
) -> GaussianProcess:
    """Maximise the marginal likelihood over the hyperparameters by L-BFGS.

    inputs (n, D) and outputs (n,) standardised. shortest: lengthscale. stop: relative decrease at which it ends. Raises
    TrainingError when the rows do not match or are not finite.
    """
    check_rows(inputs, outputs)
    d = inputs.shape[1]
    box = np.array([(np.log(shortest), _LONGEST)] * d + [_SIGNAL_BOUNDS, _NOISE_BOUNDS])
    descent, cost = Descent(box, most_iterations, stop), _cost(inputs, outputs)
    rows = part_of_rows(len(outputs))
    start, rough = _first(inputs, outputs, rows, replace(descent, stop=ROUGH_STOP))
    if rows is None or len(rows) >= _FEWEST_TO_BEGIN_FROM:
        found = descent.refine(cost, rough)
    else:
        found = descent.run(cost, start)
    return GaussianProcess(inputs, outputs, _parameters(found.point))


def _first(inputs: Array, outputs: Array, rows: IntArray | None, descent: Descent) -> tuple[Array, Minimum]:
    """Where to begin, and the minimum of these rows that is reached from there; None for all rows.

    Unit lengthscales, or one of them short if that is clearly better. On a polygon the outcome jumps from side to side.
    From a long lengthscale the search may take the jumps for noise.
    """
    d, part = inputs.shape[1], slice(None) if rows is None else rows
    usual, cost = np.append(np.zeros(d + 1), np.log(0.3)), _cost(inputs[part], outputs[part])
    short = [usual + _SHORT * np.eye(d + 2)[k] for k in range(d)] if len(outputs) >= _FEWEST_FOR_SHORT else []
    reached = [(start, descent.run(cost, start)) for start in (usual, *short)]
    best = min(reached, key=lambda pair: pair[1].cost)
    return best if best[1].cost < reached[0][1].cost - _SURELY else reached[0]


def log_likelihood_and_gradient(inputs: Array, outputs: Array, parameters: GpParameters) -> tuple[float, Array]:
    """Log p(outputs | inputs) and its derivative wrt (log lengthscales, log signal sd, log noise sd), (D + 2,).

    Raises LinAlgError where the kernel matrix plus noise is not positive definite.
    """
    noise = parameters.noise_variance
    likelihood = Likelihood.of(DenseKernel.of(parameters.kernel, inputs), outputs, np.full(len(outputs), noise))
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
