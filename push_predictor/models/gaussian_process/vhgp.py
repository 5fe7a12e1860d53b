# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Variational heteroscedastic Gaussian process regression (Lazaro-Gredilla and Titsias, ICML 2011).

    y = f(x) + e,  f ~ GP(0, k_f),  e ~ N(0, exp(g(x))),  g ~ GP(mu0, k_g)

The model of Bauza and Rodriguez (ICRA 2017) for planar pushing, derived from first principles;
docs/explanation/errata.md lists where the printed equations differ. Inputs and outputs are standardised by the caller.
"""

from __future__ import annotations

from functools import cached_property
from typing import TypeAlias

import numpy as np

from push_predictor.blas_threads import one_blas_thread
from push_predictor.models.gaussian_process.bound import Bound, VhgpParameters, VhgpProblem
from push_predictor.models.gaussian_process.fit import maximise_bound, precisions_from
from push_predictor.models.gaussian_process.gp import (
    MOST_SEARCHED,
    SHORTEST,
    GpParameters,
    check_rows,
    fit_gp,
    some_rows,
)
from push_predictor.models.gaussian_process.inducing import InducedPosterior
from push_predictor.models.gaussian_process.prediction import LatentPrediction, Remembered
from push_predictor.models.gaussian_process.ridge import DenseKernel, DensePosterior
from push_predictor.types import Array, IntArray

Posterior: TypeAlias = DensePosterior | InducedPosterior

_EPSILON = float(np.finfo(np.float64).eps)


class VHGP:
    """A VHGP conditioned on inputs (n, D) and outputs (n,); site_precisions (n,) is Lambda of bound.py.

    Its matrices are computed at the first prediction: a server that predicts from a table may never need them.
    """

    gaussian = False  # predictive distribution

    def __init__(self, inputs: Array, outputs: Array, parameters: VhgpParameters, site_precisions: Array) -> None:
        self.inputs, self.outputs = check_rows(inputs, outputs), outputs
        self.parameters, self.site_precisions = parameters, site_precisions
        self._known: Remembered[LatentPrediction] = Remembered()
        self._held_out: Remembered[LatentPrediction] = Remembered()

    @cached_property
    def solved(self) -> Bound:
        """The bound on the log marginal likelihood, with the quantities that predictions need: two (n, n) matrices."""
        with one_blas_thread():
            signal, noise = (DenseKernel(k, self.inputs) for k in (self.parameters.signal, self.parameters.noise))
            problem = VhgpProblem(self.outputs, self.parameters, signal, noise)
            bound = Bound.tied(problem, self.site_precisions)
            signal.free_matrix()
            noise.free_matrix()
            return bound

    @property
    def bound(self) -> float:
        """The variational bound on the log marginal likelihood."""
        return self.solved.value

    def free_matrices(self) -> None:
        """Free the matrices, which the next prediction computes again."""
        for name in ("solved", "functions"):
            self.__dict__.pop(name, None)  # a cached property

    @cached_property
    def functions(self) -> tuple[Posterior, Posterior]:
        """The posteriors of f, and of g less its prior mean and without its nugget."""
        bound = self.solved
        signal = bound.signal.likelihood
        return signal.ridge.posterior(signal.alpha), bound.noise_ridge.posterior(bound.mean_weights)

    def predict(self, inputs: Array) -> LatentPrediction:
        """Predict f and g at inputs (m, D)."""
        return self._known.of(lambda: self._predicted(inputs), inputs)

    def _predicted(self, inputs: Array) -> LatentPrediction:
        parameters, (signal, noise) = self.parameters, self.functions
        of_signal, of_noise = parameters.signal.variance, parameters.noise.variance
        mean, explained = signal.predict(inputs)
        log_noise, noise_explained = noise.predict(inputs)
        # The jitter is independent of the data, so the variance of f cannot fall below it.
        variance = np.maximum(of_signal + parameters.jitter - explained, parameters.jitter)
        log_noise_variance = parameters.nugget + np.maximum(of_noise - noise_explained, _EPSILON * of_noise)
        return LatentPrediction(mean, variance, parameters.noise_mean + log_noise, log_noise_variance)

    def function_covariance(self, inputs: Array) -> Array:
        """Posterior covariance (m, m) of f between inputs (m, D), without the jitter, of which data tell nothing."""
        return self.functions[0].covariance(inputs)

    def held_out(self, block: IntArray) -> LatentPrediction:
        """Predict f and g at the n training rows, each from the rows of all other blocks (n,), without a new fit."""
        return self._held_out.of(lambda: self._predicted_without(block), block)

    def _predicted_without(self, block: IntArray) -> LatentPrediction:
        return self.solved.held_out(block)


def fit_vhgp(
    inputs: Array,
    outputs: Array,
    *,
    start: GpParameters | None = None,
    most_iterations: int = 40,
    shortest: float = SHORTEST,
    rough: bool = False,
) -> VHGP:
    """Maximise the variational bound (plus weak priors, see fit.py) over hyperparameters and site precisions.

    inputs (n, D) and outputs (n,) standardised. start: a homoscedastic fit of these rows or some of them; None
    computes it first. shortest: lengthscale of the signal. rough: whether the hyperparameters are those of
    MOST_SEARCHED rows, for fits that another begins from, and residuals about mechanics, which are smooth. Raises
    TrainingError when the rows do not match or are not finite.
    """
    check_rows(inputs, outputs)
    rows = some_rows(len(outputs), MOST_SEARCHED)
    few = inputs[rows], outputs[rows]
    near = start or fit_gp(*few, shortest=shortest, rough=True).parameters
    found = VHGP(*few, *maximise_bound(*few, near, most_iterations, shortest))
    if len(rows) == len(outputs):
        return found
    if not rough:
        return VHGP(
            inputs, outputs, *maximise_bound(inputs, outputs, near, most_iterations, shortest, found.parameters)
        )
    problem = VhgpProblem.of(inputs, outputs, found.parameters)
    return VHGP(inputs, outputs, found.parameters, precisions_from(problem, found.predict(inputs)))
