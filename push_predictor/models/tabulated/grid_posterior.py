# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The posteriors of a regression at all points of a grid, at a fraction of the cost of single points.

A squared exponential kernel is a product over the axes of a grid, so no exponential is taken per point. A kernel
matrix has a low numerical rank r: K = G G' from a pivoted Cholesky factorisation with pivots Z and triangle T = G_Z.
With D the noise variances and G' D^-1 G = V diag(d) V', the explained variance is

    k(x, X) (K + D)^-1 k(X, x) = | diag(d / (1 + d))^1/2 V' T^-1 k(Z, x) |^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import TypeAlias

import numpy as np
import scipy

from push_predictor.models.gaussian_process.gp import GaussianProcess
from push_predictor.models.gaussian_process.inducing import InducedPosterior
from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.regression import ConstantNoise, Regression
from push_predictor.models.gaussian_process.vhgp import Posterior
from push_predictor.types import Array, IntArray

_DROPPED = 1e-4  # of the smallest noise variance: a prior variance that is negligible next to the noise
_ROUNDING = 1e-13
_EPSILON = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class GridPosterior:
    """The posterior of a function f with a prior mean of zero.

    kernel; inputs (n, D); weights (n,), the mean is k(x, X) weights; pivots Z (r,): rows of the inputs; root (r, s)
    makes of the correlations with Z a vector whose squared norm is the explained variance. prior_variance, of f at any
    point; least_variance, what its posterior variance cannot fall below.
    """

    kernel: ArdKernel
    inputs: Array
    weights: Array
    pivots: IntArray
    root: Array
    prior_variance: float
    least_variance: float

    def moments(self, factors: Sequence[Array]) -> tuple[Array, Array]:
        """Mean and variance at the points of a grid, each (m_1, ..., m_D).

        factors: for each axis the (m_d, n) factors of the correlations between its points and the inputs.
        """
        first, rest = factors[0], reduce(_all_pairs, factors[1:], np.ones((1, len(self.weights))))
        mean = (first * (self.kernel.variance * self.weights)) @ rest.T
        first, rest = first[:, self.pivots], rest[:, self.pivots]
        explained = np.array([_squared_norms((rest * row) @ self.root) for row in first])
        variance = np.maximum(self.prior_variance - explained, self.least_variance)
        shape = [len(factor) for factor in factors]
        return mean.reshape(shape), variance.reshape(shape)


@dataclass(frozen=True, eq=False)
class GridRegression:
    """The posterior of f; log_noise, the log noise variance or its prior mean; the posterior of what is added to that,
    None where the noise is the same everywhere.
    """

    signal: GridPosterior
    log_noise: float
    noise: GridPosterior | None


OnGrid: TypeAlias = GridRegression | ConstantNoise


def on_grid(regression: Regression) -> OnGrid:
    """The posteriors of any regression, to be evaluated on grids."""
    if isinstance(regression, ConstantNoise):
        return regression
    if isinstance(regression, GaussianProcess):
        parameters, prior = regression.parameters, regression.parameters.kernel.variance
        signal = _of_function(regression.posterior, prior, _EPSILON * prior)
        return GridRegression(signal, 2.0 * parameters.log_noise_sd, None)
    of_vhgp, (f, g) = regression.parameters, regression.functions
    of_noise, nugget = of_vhgp.noise.variance, of_vhgp.nugget
    signal = _of_function(f, of_vhgp.signal.variance + of_vhgp.jitter, of_vhgp.jitter)
    noise = _of_function(g, of_noise + nugget, nugget + _EPSILON * of_noise)
    return GridRegression(signal, of_vhgp.noise_mean, noise)


def _of_function(posterior: Posterior, prior_variance: float, least_variance: float) -> GridPosterior:
    if isinstance(posterior, InducedPosterior):  # needs no factorisation
        kernel, inputs = posterior.known.kernel, posterior.known.inputs
        root = kernel.variance * posterior.root
        pivots = np.arange(len(inputs))
        return GridPosterior(kernel, inputs, posterior.weights, pivots, root, prior_variance, least_variance)
    known, noises = posterior.ridge.of_kernel, 1.0 / posterior.ridge.weights
    kernel, inputs = known.kernel, known.inputs
    dropped = max(_DROPPED * float(noises.min()) / kernel.variance, _ROUNDING)
    factor, pivots, rank, _ = scipy.linalg.lapack.dpstrf(kernel.matrix(inputs), tol=dropped * kernel.variance, lower=1)
    basis, order = np.tril(factor[:, :rank]), pivots - 1
    weighted = basis / np.sqrt(noises[order])[:, None]
    information, vectors = np.linalg.eigh(weighted.T @ weighted)
    share = information / (1.0 + information)
    kept = share > dropped
    scaled = vectors[:, kept] * np.sqrt(share[kept])
    root = scipy.linalg.blas.dtrsm(kernel.variance, basis[:rank], scaled, lower=1, trans_a=1)
    return GridPosterior(kernel, inputs, posterior.weights, order[:rank], root, prior_variance, least_variance)


def weighted_sums(factors: Sequence[Array], weights: Array) -> Array:
    """Sums over n rows at the points of a grid, (m_1, ..., m_D, k), of weights (n, k) times the product of the factors.

    factors: for each axis, (m_d, n).
    """
    first, *others = factors
    if not others:
        return np.asarray(first @ weights)
    if len(others) == 1:
        return np.stack([(first * column) @ others[0].T for column in weights.T], axis=-1)
    return np.stack([weighted_sums(others, weights * row[:, None]) for row in first])


def _all_pairs(left: Array, right: Array) -> Array:
    return (left[:, None, :] * right).reshape(-1, left.shape[1])


def _squared_norms(rows: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", rows, rows))
