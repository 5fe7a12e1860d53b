# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The correlation of the three outputs given the push, learnt from the residuals of held-out training pushes.

The paper fits three independent outputs. Their residuals are correlated, and how depends on the push: off the centre,
a push that moves the slider further turns it further. With z_i the standardised held-out residuals at features x_i

    S(x) = shrinkage I + sum_i exp(-|x - x_i|^2 / (2 bandwidth^2)) z_i z_i',    C = diag(S)^-1/2 S diag(S)^-1/2

is a correlation matrix everywhere, and the identity where no training push is near. `correlation_fit` learns it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.types import Array, IntArray

PAIRS = ((0, 1), (0, 2), (1, 2))
_ROWS, _COLUMNS = np.array([(0, 0), (1, 1), (2, 2), *PAIRS]).T
_PLACES = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])  # of the six products in a symmetric matrix
_WEIGHTS_AT_ONCE = 2_000_000  # 16 MB


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
        return correlations(self._sums(features, None), self.shrinkage)

    def held_out(self, features: Array, block: IntArray) -> Array:
        """Correlations (N, 3, 3) at all N training rows, features (N, D), each from the rows of other blocks (N,)."""
        return correlations(self.held_out_sums(features, block), self.shrinkage)

    def held_out_sums(self, features: Array, block: IntArray) -> Array:
        """The weighted sums of `products` over the rows of all other blocks, (N, 6)."""
        return self._sums(features, block)

    @cached_property
    def kernel(self) -> ArdKernel:
        """The weights of the rows as a kernel of the features."""
        size = self.features.shape[1]
        return ArdKernel(np.full(size, np.log(self.bandwidth)), 0.0)

    @cached_property
    def products(self) -> Array:
        """Of each row's residuals, (n, 6): the three squares, then the products of PAIRS."""
        return np.asarray(self.residuals[:, _ROWS] * self.residuals[:, _COLUMNS])

    def _sums(self, features: Array, block: IntArray | None) -> Array:
        step = max(1, _WEIGHTS_AT_ONCE // max(1, len(self.features)))
        sums = np.empty((len(features), 6))
        for start in range(0, len(features), step):
            part = slice(start, start + step)
            weights = self.kernel.cross(features[part], self.features)
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
