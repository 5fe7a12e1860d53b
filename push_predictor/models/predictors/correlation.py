# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The correlation of the three outputs given the push, learnt from the residuals of held-out training pushes.

The paper fits three independent outputs. Their residuals are correlated, and how depends on the push: off the centre,
a push that moves the slider further turns it further. With z_i the standardised held-out residuals at features x_i

    S(x) = shrinkage I + sum_i exp(-|x - x_i|^2 / (2 bandwidth^2)) z_i z_i',    C = diag(S)^-1/2 S diag(S)^-1/2

is a correlation matrix everywhere, and the identity where no training push is near.

It is learnt from held-out pushes, and the same pushes decide whether there is one. The regressions predict each push
without its windows (gaussian_process/ridge.py), and the correlation at a push is smoothed over all others. Residuals
have heavy tails, and a single outlier would determine the correlation of its whole neighbourhood. So none counts for
more than its expected length, 3^1/2 standard deviations.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.regression import Regression
from push_predictor.models.gaussian_process.ridge import DenseKernel
from push_predictor.types import Array, IntArray

PAIRS = ((0, 1), (0, 2), (1, 2))
_ROWS, _COLUMNS = np.array([(0, 0), (1, 1), (2, 2), *PAIRS]).T
_PLACES = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])  # of the six products in a symmetric matrix
_WEIGHTS_AT_ONCE = 2_000_000  # 16 MB
BANDWIDTHS = (0.2, 0.3, 0.4, 0.6, 0.9, 1.4, 2.5)  # standard deviations of the features
SHRINKAGES = (2.0, 5.0, 10.0, 20.0, 50.0)  # rows
LONGEST = 3.0**0.5
FEWEST_PUSHES = 10
MOST_ROWS = 2000  # that it is learnt from and keeps, at random: a prediction must not cost more with more rows
MOST_BLOCKS = 300  # in which pushes are held out
CLEARLY = 2.0  # standard errors, from push to push


@dataclass(frozen=True, eq=False)
class Correlation:
    """A smoother of residuals over the features; see the module.

    features (n, D) standardised and residuals (n, 3) of training rows; bandwidth > 0 in units of the features;
    shrinkage > 0 in rows. rows (n,): which of the training rows these are, None for all of them.
    """

    features: Array
    residuals: Array
    bandwidth: float
    shrinkage: float
    rows: IntArray | None = None

    def at(self, features: Array) -> Array:
        """Correlation matrices (m, 3, 3) at features (m, D)."""
        return correlations(self.sums(features), self.shrinkage)

    def held_out(self, features: Array, block: IntArray) -> Array:
        """Correlations (N, 3, 3) at all N training rows, features (N, D), each from the rows of other blocks (N,)."""
        return correlations(self.sums(features, block), self.shrinkage)

    @cached_property
    def known(self) -> DenseKernel:
        """The weights of the rows as a kernel of the features."""
        size = self.features.shape[1]
        return DenseKernel(ArdKernel(np.full(size, np.log(self.bandwidth)), 0.0), self.features)

    @cached_property
    def products(self) -> Array:
        """Of each row's residuals, (n, 6): the three squares, then the products of PAIRS."""
        return np.asarray(self.residuals[:, _ROWS] * self.residuals[:, _COLUMNS])

    def sums(self, features: Array, block: IntArray | None = None) -> Array:
        """The weighted sums of `products` (N, 6) over all rows, or over those of blocks other than the row's (N,)."""
        step = max(1, _WEIGHTS_AT_ONCE // max(1, len(self.features)))
        sums = np.empty((len(features), 6))
        for start in range(0, len(features), step):
            part = slice(start, start + step)
            weights = self.known.cross(features[part])
            if block is not None:
                weights[block[part, None] == (block if self.rows is None else block[self.rows])] = 0.0
            sums[part] = weights @ self.products
        return sums


def correlations(sums: Array, shrinkage: float) -> Array:
    """Correlation matrices (m, 3, 3) of sums (m, 6) of `products` over rows."""
    shrunk = sums[:, :3] + shrinkage
    scale = 1.0 / np.sqrt(shrunk)
    matrices = sums[:, _PLACES] * (scale[:, :, None] * scale[:, None, :])
    index = np.arange(3)
    matrices[:, index, index] = 1.0
    return np.asarray(matrices)


def correlated(standard_deviation: Array, correlation: Array) -> Array:
    """Covariance matrices (n, 3, 3) of standard deviations (n, 3) and correlation matrices (n, 3, 3)."""
    return np.asarray(correlation * (standard_deviation[:, :, None] * standard_deviation[:, None, :]))


def covariances(latent: Array, process: Array, correlation: Array | None) -> tuple[Array, Array]:
    """Covariance matrices (n, 3, 3) of outcomes and of the process, from the variances (n, 3) of the latent functions
    and of the process and correlation matrices (n, 3, 3), None where the outputs are independent.

    The model's uncertainty has the correlation of the noise that causes it, so that outcome minus process is also a
    covariance.
    """
    if correlation is None:
        return _diagonal(latent + process), _diagonal(process)
    of_process = correlated(np.sqrt(process), correlation)
    return of_process + correlated(np.sqrt(latent), correlation), of_process


def _diagonal(variances: Array) -> Array:
    count, size = variances.shape
    matrices = np.zeros((count, size * size))
    matrices[:, :: size + 1] = variances
    return matrices.reshape(count, size, size)


def fit_correlation(regressions: Sequence[Regression], push_ids: np.ndarray) -> Correlation | None:
    """The correlation of the outputs of regressions, from their training rows and the push (n,) of each.

    Bandwidth and shrinkage maximise the likelihood of the held-out pushes. None, for independence, if that likelihood
    is not CLEARLY above the one of independent outputs, or if there are fewer than FEWEST_PUSHES.
    """
    pushes, push = np.unique(push_ids, return_inverse=True)
    if len(pushes) < FEWEST_PUSHES:
        return None
    block = np.asarray(push % MOST_BLOCKS, dtype=np.int64)
    best, gains = max(_candidates(regressions, block), key=lambda candidate: float(candidate[1].sum()))
    error = np.sqrt(len(gains)) * gains.std(ddof=1)
    return best if gains.sum() > CLEARLY * error else None


def _candidates(regressions: Sequence[Regression], block: IntArray) -> Iterator[tuple[Correlation, Array]]:
    """Correlations, each with its gain in log likelihood of held-out pushes over independence, (blocks,) nats."""
    rows, count = np.sort(np.random.default_rng(0).permutation(len(block))[:MOST_ROWS]), len(block)
    known, features, block = _held_out(regressions, block, rows), regressions[0].inputs[rows], block[rows]
    kept = rows if len(rows) < count else None
    for bandwidth in BANDWIDTHS:
        smoother = Correlation(features, known.bounded, bandwidth, SHRINKAGES[0])
        sums = smoother.sums(features, block)
        for shrinkage in SHRINKAGES:
            gains = known.gains(correlations(sums, shrinkage))
            candidate = replace(smoother, shrinkage=shrinkage, rows=kept)
            yield candidate, np.asarray(np.bincount(block, gains), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class _HeldOut:
    """Residuals of held-out rows, and the predicted variances of function and noise: (n, 3) each."""

    residuals: Array
    of_function: Array
    of_process: Array

    @property
    def bounded(self) -> Array:
        """Residuals in units of the prediction, none longer than LONGEST, rounded as in a model file."""
        scaled = self.residuals / np.sqrt(self.of_function + self.of_process)
        longest = np.maximum(np.linalg.norm(scaled, axis=1, keepdims=True), LONGEST)
        return np.asarray((scaled * LONGEST / longest).astype(np.float32), dtype=np.float64)

    def gains(self, correlation: Array) -> Array:
        """Log densities (n,) with correlation matrices (n, 3, 3) minus those of independent outputs."""
        joint, alone = (self._log_density(matrices) for matrices in (correlation, None))
        return np.asarray(joint - alone)

    def _log_density(self, correlation: Array | None) -> Array:
        covariance, _ = covariances(self.of_function, self.of_process, correlation)
        lower = np.linalg.cholesky(covariance)
        z = np.linalg.solve(lower, self.residuals[:, :, None])[:, :, 0]
        diagonal = np.diagonal(lower, axis1=1, axis2=2)
        return np.asarray(-0.5 * np.sum(z**2, axis=1) - np.sum(np.log(diagonal), axis=1))


def _held_out(regressions: Sequence[Regression], block: IntArray, rows: IntArray) -> _HeldOut:
    latent = [regression.held_out(block) for regression in regressions]
    outputs = [regression.outputs for regression in regressions]
    return _HeldOut(
        np.column_stack([y - p.mean for y, p in zip(outputs, latent, strict=True)])[rows],
        np.column_stack([p.variance for p in latent])[rows],
        np.column_stack([p.process_variance for p in latent])[rows],
    )
