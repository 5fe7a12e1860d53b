"""Likelihoods of Gaussian processes as the textbook has them, to compare the product's with."""

from __future__ import annotations

import numpy as np

from push_predictor.models.gaussian_process.gp import GaussianProcess
from push_predictor.models.gaussian_process.vhgp_bound import Bound, VhgpProblem
from push_predictor.models.gaussian_process.vhgp_parameters import VhgpParameters
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
    return bound.value, bound.site_gradient(), bound.hyperparameter_gradient(tied=True)
