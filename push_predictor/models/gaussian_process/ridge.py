# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A kernel matrix K regularised by a positive diagonal D, as both Gaussian processes of a VHGP need it.

With w = 1/D, every quantity here belongs to the posterior of a function with prior covariance K that is seen
through noise of variance D. Kernel matrices of smooth functions are of low numerical rank when there are many
inputs, so K = V V' with V (n, r) from a pivoted Cholesky factorisation; the remainder, below 1e-12 of K's
diagonal, is dropped. Where the rank is not low the dense matrix is used.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy

from push_predictor.models.gaussian_process.kernels import ArdKernel, mirror_upper
from push_predictor.types import Array, IntArray

_DROPPED = 1e-12
_SMALLEST_FACTORISED = 200
_LARGEST_SHARE = 0.5
_LARGEST_SHARE_OF_HALF = 0.35  # of all rows: a higher rank of every second row makes the search not worthwhile


@dataclass(frozen=True, eq=False)
class DenseKernel:
    """The matrix K (n, n) of a kernel between inputs (n, D), with its root (r, n), K = root' root, if r is low.

    Factorised once, to be regularised by many diagonals. unexplained: prior variance of the function that K lacks.
    """

    kernel: ArdKernel
    inputs: Array
    matrix: Array
    root: Array | None
    unexplained: ClassVar[float] = 0.0

    @classmethod
    def of(cls, kernel: ArdKernel, inputs: Array) -> DenseKernel:
        """Build and factorise the matrix."""
        matrix = kernel.matrix(inputs)
        return cls(kernel, inputs, matrix, _low_rank_root(matrix))

    def regularise(self, weights: Array) -> DenseRidge:
        """The ridge for D = 1/weights, weights (n,) > 0. Raises LinAlgError if it is not positive definite."""
        return _FullRankRidge.of(self, weights) if self.root is None else _LowRankRidge.of(self, self.root, weights)

    def times(self, vector: Array) -> Array:
        """K vector, shape (n,)."""
        return np.asarray(self.matrix @ vector)


def _low_rank_root(matrix: Array) -> Array | None:
    n = len(matrix)
    if n < _SMALLEST_FACTORISED or _rank_of_half(matrix) > _LARGEST_SHARE_OF_HALF * n:
        return None
    factor, pivots, rank, _ = scipy.linalg.lapack.dpstrf(matrix.T, tol=_DROPPED * matrix[0, 0], lower=1)
    if rank > _LARGEST_SHARE * n:
        return None
    root = np.empty((rank, n))
    root[:, pivots - 1] = np.tril(factor[:, :rank]).T
    return root


def _rank_of_half(matrix: Array) -> int:
    """The rank of every second row and column, for an eighth of the time; that of all is not lower."""
    half = matrix[::2, ::2].T.copy(order="F")
    return int(scipy.linalg.lapack.dpstrf(half, tol=_DROPPED * matrix[0, 0], lower=1, overwrite_a=1)[2])


def cholesky_in_place(matrix: Array) -> Array:
    """Lower Cholesky factor in the memory of a symmetric C-ordered matrix, itself in Fortran order.

    Raises LinAlgError where the matrix is not positive definite.
    """
    factor, info = scipy.linalg.lapack.dpotrf(matrix.T, lower=1, clean=1, overwrite_a=1)
    # Whether LAPACK notices a NaN depends on its place in the matrix.
    if info != 0 or not np.isfinite(factor[-1, -1]):
        raise np.linalg.LinAlgError(f"matrix of {len(matrix)} rows is not positive definite")
    return np.asarray(factor)


@dataclass(frozen=True, eq=False)
class DenseRidge(ABC):
    """Quantities of P = (K + D)^-1 with D = 1/w: weights w (n,), log_determinant of I + w^1/2 K w^1/2."""

    of_kernel: DenseKernel
    weights: Array
    log_determinant: float

    @property
    @abstractmethod
    def posterior_diagonal(self) -> Array:
        """Diagonal of K - K P K, shape (n,)."""

    @abstractmethod
    def residual(self, values: Array) -> Array:
        """P D values, shape (n,): the residual of a smoother of these values."""

    @abstractmethod
    def upper_precision(self) -> Array:
        """P in the upper triangle of a C-ordered matrix (n, n), whose other elements have no meaning."""

    def precision(self) -> Array:
        """P itself, shape (n, n)."""
        return mirror_upper(self.upper_precision())

    def gradient(self, added: Array, removed: Array | None = None, weights: Array | None = None) -> Array:
        """1/2 tr((added added' - removed removed' - P) dK) - 1/2 sum weights d(unexplained), vectors (n,).

        d is by the kernel's log_lengthscales and log_sd, and by the log standard deviation of its nugget if there is
        one, shape (D + 1,) or (D + 2,). weights: w if not given. A dense kernel leaves nothing unexplained.
        """
        precision, kernel = self.upper_precision(), self.of_kernel
        for sign, vector in ((-1.0, added), (1.0, removed)):
            if vector is not None:
                scipy.linalg.blas.dsyr(sign, vector, lower=1, a=precision.T, overwrite_a=1)
        return -0.5 * kernel.kernel.gradient(kernel.inputs, kernel.matrix, precision)

    def held_out_errors(self, weights: Array, block: IntArray) -> tuple[Array, Array]:
        """Errors (n,) of the leave-block-out predictions of n values, and their variances (n,), D included.

        weights (n,): P times the values; block (n,): number of each row's block. For a block B of the rows, the mean is
        y_B - P_BB^-1 (P y)_B and the variance is diag P_BB^-1 (Rasmussen and Williams 2006, section 5.4.2, for a block
        in place of a row).
        """
        precision = self.precision()
        errors, variance = np.empty(len(weights)), np.empty(len(weights))
        for number in np.unique(block):
            rows = np.flatnonzero(block == number)
            covariance = np.linalg.inv(precision[np.ix_(rows, rows)])
            errors[rows], variance[rows] = covariance @ weights[rows], np.diagonal(covariance)
        return errors, variance


@dataclass(frozen=True, eq=False)
class _LowRankRidge(DenseRidge):
    shrunk_root: Array  # T (r, n) with K - K P K = T'T

    @classmethod
    def of(cls, kernel: DenseKernel, root: Array, weights: Array) -> _LowRankRidge:
        weighted = root * np.sqrt(weights)
        inner = weighted @ weighted.T
        inner.flat[:: len(inner) + 1] += 1.0
        factor = cholesky_in_place(inner)
        # T' L' = root' solved from the right, so that LAPACK's columns are our rows
        shrunk = scipy.linalg.blas.dtrsm(1.0, factor, root.T, side=1, lower=1, trans_a=1).T
        return cls(kernel, weights, _log_determinant(factor), shrunk)

    @property
    def posterior_diagonal(self) -> Array:
        return np.asarray(np.einsum("ij,ij->j", self.shrunk_root, self.shrunk_root))

    def residual(self, values: Array) -> Array:
        return values - (self.shrunk_root @ values) @ self.shrunk_root * self.weights

    def upper_precision(self) -> Array:
        weighted = self.shrunk_root * self.weights
        # Fortran's lower triangle is the upper one of the C-ordered transpose.
        matrix = scipy.linalg.blas.dsyrk(-1.0, weighted.T, lower=1).T
        matrix.flat[:: len(matrix) + 1] += self.weights
        return np.asarray(matrix)


@dataclass(frozen=True, eq=False)
class _FullRankRidge(DenseRidge):
    inverse_root: Array  # L^-1 of L L' = I + w^1/2 K w^1/2

    @classmethod
    def of(cls, kernel: DenseKernel, weights: Array) -> _FullRankRidge:
        scale = np.sqrt(weights)
        inner = kernel.matrix * scale
        inner *= scale[:, None]
        inner.flat[:: len(inner) + 1] += 1.0
        factor = cholesky_in_place(inner)
        log_determinant = _log_determinant(factor)
        inverse, _ = scipy.linalg.lapack.dtrtri(factor, lower=1, overwrite_c=1)
        return cls(kernel, weights, log_determinant, inverse)

    @property
    def posterior_diagonal(self) -> Array:
        explained = np.einsum("ij,ij->j", self.inverse_root, self.inverse_root)
        return np.asarray((1.0 - explained) / self.weights)

    def residual(self, values: Array) -> Array:
        scale = np.sqrt(self.weights)
        return scale * (self.inverse_root.T @ (self.inverse_root @ (values / scale)))

    def upper_precision(self) -> Array:
        # L'L in Fortran's lower triangle, for a sixth of a product's operations.
        matrix, _ = scipy.linalg.lapack.dlauum(self.inverse_root, lower=1)
        scale = np.sqrt(self.weights)
        matrix *= scale
        matrix *= scale[:, None]
        return np.asarray(matrix.T)


def _log_determinant(factor: Array) -> float:
    return 2.0 * float(np.log(np.diagonal(factor)).sum())
