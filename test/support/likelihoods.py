# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Likelihoods of Gaussian processes as the textbook has them, to compare the product's with."""

from __future__ import annotations

import numpy as np

from push_predictor.models.gaussian_process.bound import Bound, VhgpParameters, VhgpProblem
from push_predictor.models.gaussian_process.gp import GaussianProcess
from push_predictor.types import Array


def log_marginal_likelihood(gp: GaussianProcess) -> float:
    """Log p(outputs | inputs), nats (Rasmussen and Williams 2006, algorithm 2.1)."""
    n, parameters = len(gp.outputs), gp.parameters
    lower = np.linalg.cholesky(parameters.kernel.matrix(gp.inputs) + parameters.noise_variance * np.eye(n))
    whitened = np.linalg.solve(lower, gp.outputs)
    return float(-0.5 * whitened @ whitened - np.log(np.diagonal(lower)).sum() - 0.5 * n * np.log(2.0 * np.pi))


def bound_and_gradient(
    inputs: Array, outputs: Array, parameters: VhgpParameters, site_precisions: Array
) -> tuple[float, Array, Array]:
    """F with b = Lambda - 1/2, dF/d(site_precisions) (n,) and dF/d(parameters.to_vector())."""
    bound = Bound.tied(VhgpProblem.of(inputs, outputs, parameters), site_precisions)
    matrix = parameters.noise.matrix(inputs)
    kernel = matrix + parameters.nugget * np.eye(len(matrix))
    precision = np.linalg.inv(kernel + np.diag(1.0 / site_precisions))
    return bound.value, _site_gradient(bound, kernel, precision), _tied_gradient(bound, inputs, matrix, precision)


def _site_gradient(bound: Bound, kernel: Array, precision: Array) -> Array:
    """dF/dLambda with b = Lambda - 1/2 tied to it: -(K_g + 1/2 S o S)(Lambda - optimal), shape (n,)."""
    posterior = kernel - kernel @ precision @ kernel
    return np.asarray(-(kernel + 0.5 * posterior**2) @ (bound.sites.precisions - bound.signal.optimal_precisions))


def _tied_gradient(bound: Bound, inputs: Array, matrix: Array, precision: Array) -> Array:
    """dF/d(parameters) with b tied to Lambda: the product's gradient and a term that vanishes at a maximum."""
    parameters, gradient = bound.problem.parameters, bound.hyperparameter_gradient()
    unbalance = (bound.signal.optimal_precisions - bound.sites.precisions) / bound.sites.precisions**2
    weights = (precision * unbalance) @ precision
    size = len(parameters.log_lengthscales) + 1
    gradient[size : 2 * size] -= 0.5 * parameters.noise.gradient(inputs, matrix, weights)
    gradient[-1] -= parameters.nugget * float(np.trace(weights))
    return gradient
