"""What a regression says of its own rows when it has not seen them, block by block, from what was solved with all.

For a Gaussian process with P = (K + D)^-1 and a block B of its rows, left out are (Rasmussen and Williams 2006, section
5.4.2, for a block in place of a row)

    mean = y_B - P_BB^-1 (P y)_B,     variance of y = diag P_BB^-1

A VHGP consists of two: the signal, seen through the noise level R, and the log noise variance, seen through the sites
of q(g), whose values are m + b / Lambda (vhgp_bound.py). R and the sites of the other rows stay as they are: solving
for them anew without B changes them little, and takes forty times as long (Vehtari et al. 2016, "Bayesian leave-one-out
cross-validation approximations for Gaussian latent variable models").
"""

from __future__ import annotations

import numpy as np

from push_predictor.models.gaussian_process.gp import GaussianProcess
from push_predictor.models.gaussian_process.prediction import LatentPrediction
from push_predictor.models.gaussian_process.ridge import factorise
from push_predictor.models.gaussian_process.sparse.cross_validation import sparse_left_out
from push_predictor.models.gaussian_process.sparse.vhgp import SparseVHGP
from push_predictor.models.gaussian_process.vhgp import VHGP
from push_predictor.models.gaussian_process.vhgp_bound import Bound, VhgpProblem
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.types import Array, IntArray


def moments_left_out(predictor: GaussianProcessPredictor, block: IntArray) -> tuple[Array, Array, Array]:
    """What `body.moments` would be at each training row (n,) had the body not seen the row's block; see left_out.

    The correlation of the outputs at a row is that of the other blocks' rows.
    """
    latent = [left_out(regression, block) for regression in predictor.regressions]
    return predictor.moments_of(
        latent,
        predictor.correlation.left_out(predictor.regressions[0].inputs, block) if predictor.correlation else None,
    )


def left_out(regression: GaussianProcess | VHGP | SparseVHGP, block: IntArray) -> LatentPrediction:
    """Predict f and g at each of the n training rows, by the rows of all other blocks; hyperparameters as they are.

    block (n,): the number of each row's block.
    """
    if isinstance(regression, SparseVHGP):
        return sparse_left_out(regression, block)
    return _of_vhgp(regression, block) if isinstance(regression, VHGP) else _of_gp(regression, block)


def _of_gp(regression: GaussianProcess, block: IntArray) -> LatentPrediction:
    parameters, outputs = regression.parameters, regression.outputs
    kernel, noise, n = parameters.kernel, parameters.noise_variance, len(outputs)
    ridge = factorise(kernel.matrix(regression.inputs), smooth=kernel.smooth).regularise(np.full(n, 1.0 / noise))
    missing, variance = _missing(ridge.precision(), ridge.residual(outputs / noise), block)
    smallest = np.finfo(float).eps * kernel.variance
    log_noise = np.full(n, 2.0 * parameters.log_noise_sd)
    return LatentPrediction(outputs - missing, np.maximum(variance - noise, smallest), log_noise, np.zeros(n))


def _of_vhgp(regression: VHGP, block: IntArray) -> LatentPrediction:
    parameters, outputs = regression.parameters, regression.outputs
    problem = VhgpProblem.of(regression.inputs, outputs, parameters)
    bound = Bound.tied(problem, regression.site_precisions)
    missing, variance = _missing(bound.signal.ridge.precision(), bound.alpha, block)
    not_told, of_noise = _missing(bound.noise_ridge.precision(), bound.mean_weights, block)
    seen_through = 1.0 / bound.site_precisions
    least = parameters.nugget + np.finfo(float).eps * parameters.noise.variance
    return LatentPrediction(
        outputs - missing,
        np.maximum(variance - bound.noise_level, parameters.jitter),
        bound.noise_mean + bound.mean_weights * seen_through - not_told,
        np.maximum(of_noise - seen_through, least),
    )


def _missing(precision: Array, weights: Array, block: IntArray) -> tuple[Array, Array]:
    """What the other rows miss the values of each row by (n,), and the variance of that (n,).

    precision (n, n): P; weights (n,): P times the values.
    """
    missing, variance = np.empty(len(weights)), np.empty(len(weights))
    for number in np.unique(block):
        rows = np.flatnonzero(block == number)
        covariance = np.linalg.inv(precision[np.ix_(rows, rows)])
        missing[rows], variance[rows] = covariance @ weights[rows], np.diagonal(covariance)
    return missing, variance
