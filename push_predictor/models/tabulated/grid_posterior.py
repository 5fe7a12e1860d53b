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
from functools import cached_property, reduce

import numpy as np
import scipy

from push_predictor.models.gaussian_process.bound import Bound, VhgpProblem
from push_predictor.models.gaussian_process.gp import GaussianProcess
from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.ridge import DenseKernel
from push_predictor.models.gaussian_process.sparse.vhgp import InducedPosterior, SparseVHGP
from push_predictor.models.gaussian_process.vhgp import VHGP
from push_predictor.types import Array, IntArray

_DROPPED = 1e-4  # of the smallest noise variance: a prior variance that is negligible next to the noise
_ROUNDING = 1e-13
_EPSILON = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class GridPosterior:
    """The posterior of a function f with a prior mean of zero.

    kernel; inputs (n, D); noise_variances (n,); weights (n,), the mean is k(x, X) weights; prior_variance, of f at any
    point; least_variance, what its posterior variance cannot fall below.
    """

    kernel: ArdKernel
    inputs: Array
    noise_variances: Array
    weights: Array
    prior_variance: float
    least_variance: float

    def moments(self, factors: Sequence[Array]) -> tuple[Array, Array]:
        """Mean and variance at the points of a grid, each (m_1, ..., m_D).

        factors: for each axis the (m_d, n) factors of the correlations between its points and the inputs.
        """
        first, rest = factors[0], reduce(_all_pairs, factors[1:], np.ones((1, len(self.weights))))
        mean = (first * (self.kernel.variance * self.weights)) @ rest.T
        pivots, root = self._explaining
        first, rest = first[:, pivots], rest[:, pivots]
        explained = np.array([_squared_norms((rest * row) @ root) for row in first])
        variance = np.maximum(self.prior_variance - explained, self.least_variance)
        shape = [len(factor) for factor in factors]
        return mean.reshape(shape), variance.reshape(shape)

    @cached_property
    def _explaining(self) -> tuple[IntArray, Array]:
        """Rows Z (r,) of the inputs, and the matrix (r, s) that makes of the correlations with Z a vector whose squared
        norm is the explained variance.
        """
        prior, smallest_noise = self.kernel.variance, float(self.noise_variances.min())
        dropped = max(_DROPPED * smallest_noise / prior, _ROUNDING)
        factor, pivots, rank, _ = scipy.linalg.lapack.dpstrf(
            self.kernel.matrix(self.inputs), tol=dropped * prior, lower=1
        )
        basis, order = np.tril(factor[:, :rank]), pivots - 1
        weighted = basis / np.sqrt(self.noise_variances[order])[:, None]
        information, vectors = np.linalg.eigh(weighted.T @ weighted)
        share = information / (1.0 + information)
        kept = share > dropped
        root = scipy.linalg.blas.dtrsm(prior, basis[:rank], vectors[:, kept] * np.sqrt(share[kept]), lower=1, trans_a=1)
        return order[:rank], root


@dataclass(frozen=True, eq=False)
class GridRegression:
    """The posterior of f; log_noise, the log noise variance or its prior mean; the posterior of what is added to that,
    None where the noise is the same everywhere.
    """

    signal: GridPosterior
    log_noise: float
    noise: GridPosterior | None


def grid_regression(regression: GaussianProcess | VHGP) -> GridRegression:
    """The posteriors of a regression, to be evaluated on grids."""
    return _of_vhgp(regression) if isinstance(regression, VHGP) else _of_gp(regression)


def _of_gp(regression: GaussianProcess) -> GridRegression:
    kernel, noise = regression.parameters.kernel, regression.parameters.noise_variance
    noises = np.full(len(regression.outputs), noise)
    ridge = DenseKernel.of(kernel, regression.inputs).regularise(1.0 / noises)
    weights, prior = ridge.residual(regression.outputs / noise), kernel.variance
    signal = GridPosterior(kernel, regression.inputs, noises, weights, prior, _EPSILON * prior)
    return GridRegression(signal, float(np.log(noise)), None)


def _of_vhgp(regression: VHGP) -> GridRegression:
    inputs, parameters = regression.inputs, regression.parameters
    problem = VhgpProblem.of(inputs, regression.outputs, parameters)
    bound = Bound.tied(problem, regression.site_precisions)
    jitter, nugget = parameters.jitter, parameters.nugget
    of_signal, of_noise = parameters.signal.variance, parameters.noise.variance
    seen_through, least = nugget + 1.0 / bound.site_precisions, nugget + _EPSILON * of_noise
    jittered = bound.noise_level + jitter
    signal = GridPosterior(parameters.signal, inputs, jittered, bound.alpha, of_signal + jitter, jitter)
    noise = GridPosterior(parameters.noise, inputs, seen_through, bound.mean_weights, of_noise + nugget, least)
    return GridRegression(signal, parameters.noise_mean, noise)


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


_EPSILON = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class InducedGridPosterior(GridPosterior):
    """A GridPosterior of inducing inputs; root (m, r) as in InducedPosterior, so that no factorisation is needed."""

    root: Array

    @cached_property
    def _explaining(self) -> tuple[IntArray, Array]:
        return np.arange(len(self.inputs)), self.kernel.variance * self.root


def sparse_grid_regression(regression: SparseVHGP) -> GridRegression:
    """See grid_posterior.grid_regression."""
    parameters = regression.parameters
    jitter, of_noise, nugget = parameters.jitter, parameters.noise.variance, parameters.nugget
    signal = _on_grid(regression.signal, parameters.signal.variance + jitter, jitter)
    noise = _on_grid(regression.noise, of_noise + nugget, nugget + _EPSILON * of_noise)
    return GridRegression(signal, parameters.noise_mean, noise)


def _on_grid(posterior: InducedPosterior, prior_variance: float, least_variance: float) -> InducedGridPosterior:
    inputs, weights, none = posterior.inducing, posterior.weights, np.empty(0)
    return InducedGridPosterior(posterior.kernel, inputs, none, weights, prior_variance, least_variance, posterior.root)
