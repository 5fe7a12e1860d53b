# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The squared exponential kernel with automatic relevance determination: values and derivatives.

    r^2 = sum_d ((x_d - x'_d) / l_d)^2
    k(x, x') = s^2 exp(-r^2 / 2)

Both hyperparameters are stored as logarithms. No derivative is formed as a matrix: `gradient` contracts a weight matrix
with all of them at once. Symmetric matrices are computed on the upper triangle only, block by block to stay in the
cache.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.types import Array

_BLOCK = 64


@dataclass(frozen=True)
class ArdKernel:
    """A squared exponential; log_lengthscales (D,), log_sd the log of the standard deviation s."""

    log_lengthscales: Array
    log_sd: float

    @cached_property
    def variance(self) -> float:
        """k(x, x), the same for every x."""
        return float(np.exp(2.0 * self.log_sd))

    def matrix(self, inputs: Array) -> Array:
        """Kernel between all rows of inputs (n, D), shape (n, n), exactly symmetric."""
        z = self.scaled(inputs)
        kernel = np.empty((len(z), len(z)))
        for rows, columns in _upper_blocks(len(z)):
            kernel[rows, columns] = self._values(_exponents(z[rows], z[columns]))
        return mirror_upper(kernel)

    def cross(self, left: Array, right: Array) -> Array:
        """Kernel between the rows of left (n, D) and right (m, D), shape (n, m)."""
        return self.between(self.scaled(left), self.scaled(right))

    def between(self, a: Array, b: Array) -> Array:
        """The same of scaled inputs a (n, D) and b (m, D); with n of 1, fastest where b is in Fortran order."""
        if len(a) == 1:
            away = b.T - a.T
            return self._values(-0.5 * (away * away).sum(axis=0)[None])
        kernel = np.empty((len(a), len(b)))
        for start in range(0, len(a), _BLOCK):
            kernel[start : start + _BLOCK] = self._values(_exponents(a[start : start + _BLOCK], b))
        return kernel

    def gradient(self, inputs: Array, matrix: Array, weights: Array) -> Array:
        """sum_ij weights_ij d matrix_ij / d(log_lengthscales, log_sd), shape (D + 1,).

        inputs (n, D); matrix is `self.matrix(inputs)`; weights (n, n) symmetric, of which the upper triangle is read.
        """
        z = self.scaled(inputs)
        gradient = np.zeros(z.shape[1] + 1)
        for rows, columns in _upper_blocks(len(z)):
            weighted = weights[rows, columns] * matrix[rows, columns]
            _count_once(weighted)
            gradient += 2.0 * _contracted(weighted, z[rows], z[columns])
        return gradient

    def cross_gradient(self, left: Array, right: Array, weighted: Array) -> Array:
        """sum_ij weights_ij d k(left_i, right_j) / d(log_lengthscales, log_sd), of weighted = weights * k (n, m)."""
        return _contracted(weighted, self.scaled(left), self.scaled(right))

    def scaled(self, inputs: Array) -> Array:
        """Inputs (n, D) in units of the lengthscales."""
        return inputs * self._per_unit

    @cached_property
    def _per_unit(self) -> Array:
        return np.asarray(np.exp(-self.log_lengthscales))

    def _values(self, exponents: Array) -> Array:
        """The kernel at exponents -r^2 / 2, in their memory."""
        exponents += 2.0 * self.log_sd
        return np.asarray(np.exp(exponents, out=exponents))


def mirror_upper(matrix: Array) -> Array:
    """The symmetric matrix of an upper triangle (n, n), in its memory."""
    for rows, _ in _upper_blocks(len(matrix)):
        square = matrix[rows, rows]
        square[:] = np.triu(square) + np.triu(square, 1).T
        matrix[rows.stop :, rows] = matrix[rows, rows.stop :].T
    return matrix


def _upper_blocks(n: int) -> Iterator[tuple[slice, slice]]:
    """Rows and columns of blocks that cover the upper triangle of an (n, n) matrix, each with its square in front."""
    for start in range(0, n, _BLOCK):
        yield slice(start, min(start + _BLOCK, n)), slice(start, n)


def _exponents(a: Array, b: Array) -> Array:
    """-1/2 |a_i - b_j|^2 of the rows of a (n, D) and b (m, D), shape (n, m)."""
    exponents = a @ b.T
    exponents -= 0.5 * (a * a).sum(axis=1)[:, None] + 0.5 * (b * b).sum(axis=1)
    return np.minimum(exponents, 0.0, out=exponents)  # at r = 0 rounding may leave a tiny positive one


def _count_once(block: Array) -> None:
    """Clear the block (k, m) of an upper triangle below the diagonal and halve it there: twice its sum is the whole."""
    square = block[:, : len(block)]
    square[:] = np.triu(square)
    square.flat[:: len(block) + 1] *= 0.5


def _contracted(weighted: Array, a: Array, b: Array) -> Array:
    """Sums over i, j of weighted_ij (a_i - b_j)^2 for each input, and of 2 weighted_ij, shape (D + 1,)."""
    of_rows = weighted.sum(axis=1)
    squares = of_rows @ (a * a) + weighted.sum(axis=0) @ (b * b) - 2.0 * (a * (weighted @ b)).sum(axis=0)
    return np.append(squares, 2.0 * of_rows.sum())
