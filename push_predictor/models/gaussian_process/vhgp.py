# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Variational heteroscedastic Gaussian process regression (Lazaro-Gredilla and Titsias, ICML 2011).

    y = f(x) + e,  f ~ GP(0, k_f),  e ~ N(0, exp(g(x))),  g ~ GP(mu0, k_g)

The model of Bauza and Rodriguez (ICRA 2017) for planar pushing, derived from first principles;
docs/explanation/errata.md lists where the printed equations differ. Inputs and outputs are standardised by the caller.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.blas_threads import one_blas_thread
from push_predictor.models.gaussian_process.bound import Bound, VhgpParameters, VhgpProblem
from push_predictor.models.gaussian_process.fit import maximise_bound
from push_predictor.models.gaussian_process.gp import ROUGH_STOP, SHORTEST, GpParameters, check_rows, fit_gp
from push_predictor.models.gaussian_process.posterior import KernelPosterior
from push_predictor.models.gaussian_process.prediction import LatentPrediction, Remembered
from push_predictor.models.gaussian_process.ridge import DenseKernel
from push_predictor.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class _Posterior:
    """The posteriors of f and g, the weights (n,) of their means, and the bound: matrices of n rows."""

    bound: float
    signal: KernelPosterior
    signal_weights: Array
    noise: KernelPosterior
    noise_weights: Array


class VHGP:
    """A VHGP conditioned on inputs (n, D) and outputs (n,); site_precisions (n,) is Lambda of bound.py.

    Its matrices are computed at the first prediction: a server that predicts from a table may never need them.
    """

    gaussian = False  # predictive distribution

    def __init__(self, inputs: Array, outputs: Array, parameters: VhgpParameters, site_precisions: Array) -> None:
        self.inputs, self.outputs = check_rows(inputs, outputs), outputs
        self.parameters, self.site_precisions = parameters, site_precisions
        self._held_out = Remembered(self._predicted_without)

    @property
    def bound(self) -> float:
        """The variational bound on the log marginal likelihood."""
        return self._posterior.bound

    def free_matrices(self) -> None:
        """Free the matrices, which the next prediction computes again."""
        self.__dict__.pop("_posterior", None)  # a cached property

    @cached_property
    def _posterior(self) -> _Posterior:
        with one_blas_thread():
            parameters = self.parameters
            signal, noise = (DenseKernel.of(kernel, self.inputs) for kernel in (parameters.signal, parameters.noise))
            bound = Bound.tied(VhgpProblem.about(self.outputs, parameters, signal, noise), self.site_precisions)
            value, noise_weights, noise_level = bound.value, bound.mean_weights, bound.signal.level
            del bound  # frees its matrices before the factors are computed
            of_signal = KernelPosterior(signal.matrix, noise_level + parameters.jitter)
            of_noise = KernelPosterior(noise.matrix, parameters.nugget + 1.0 / self.site_precisions)
            return _Posterior(value, of_signal, of_signal.weights(self.outputs), of_noise, noise_weights)

    def predict(self, inputs: Array) -> LatentPrediction:
        """Predict f and g at inputs (m, D)."""
        signal, noise, posterior = self.parameters.signal, self.parameters.noise, self._posterior
        of_signal, of_noise = signal.cross(inputs, self.inputs), noise.cross(inputs, self.inputs)
        # The jitter is independent of the data, so the variance of f cannot fall below it.
        variance = signal.variance + self.parameters.jitter - posterior.signal.explained_variance(of_signal)
        log_noise_variance = noise.variance + self.parameters.nugget - posterior.noise.explained_variance(of_noise)
        return LatentPrediction(
            of_signal @ posterior.signal_weights,
            np.maximum(variance, self.parameters.jitter),
            self.parameters.noise_mean + of_noise @ posterior.noise_weights,
            np.maximum(log_noise_variance, self.parameters.nugget + np.finfo(float).eps * noise.variance),
        )

    def function_covariance(self, inputs: Array) -> Array:
        """Posterior covariance (m, m) of f between inputs (m, D), without the jitter, of which data tell nothing."""
        kernel = self.parameters.signal
        return kernel.matrix(inputs) - self._posterior.signal.explained_covariance(kernel.cross(inputs, self.inputs))

    def held_out(self, block: IntArray) -> LatentPrediction:
        """Predict f and g at the n training rows, each from the rows of all other blocks (n,), without a new fit."""
        return self._held_out.of(block)

    def _predicted_without(self, block: IntArray) -> LatentPrediction:
        problem = VhgpProblem.of(self.inputs, self.outputs, self.parameters)
        return Bound.tied(problem, self.site_precisions).held_out(block)


def fit_vhgp(
    inputs: Array,
    outputs: Array,
    *,
    start: GpParameters | None = None,
    most_iterations: int = 40,
    shortest: float = SHORTEST,
) -> VHGP:
    """Maximise the variational bound (plus weak priors, see fit.py) over hyperparameters and site precisions.

    inputs (n, D) and outputs (n,) standardised. start: a homoscedastic fit of these rows or some of them; None
    computes it first. shortest: lengthscale of the signal. Raises TrainingError when the rows do not match or are not
    finite.
    """
    check_rows(inputs, outputs)
    near = start or fit_gp(inputs, outputs, shortest=shortest, stop=ROUGH_STOP).parameters
    return VHGP(inputs, outputs, *maximise_bound(inputs, outputs, near, most_iterations, shortest))
