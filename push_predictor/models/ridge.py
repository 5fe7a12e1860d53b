"""A kernel matrix K regularised by a positive diagonal D: what both Gaussian processes of a model need.

With w = 1/D, every quantity here belongs to the posterior of a function with prior covariance K that is seen
through noise of variance D. Kernel matrices of smooth functions are of low numerical rank when there are many
inputs, so K = V V' with V (n, r) from a pivoted Cholesky factorisation; the remainder, below 1e-12 of K's
diagonal, is dropped. Where the rank is not low the dense matrix is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import LinAlgError, blas, lapack

from push_predictor.types import Array

_DROPPED = 1e-12
_SMALLEST_FACTORISED = 200
_LARGEST_SHARE = 0.6


class Ridge(Protocol):
    """Quantities of P = (K + D)^-1 with D = 1/w."""

    @property
    def log_determinant(self) -> float:
        """Log det(I + w^1/2 K w^1/2)."""

    @property
    def posterior_diagonal(self) -> Array:
        """Diagonal of K - K P K, shape (n,)."""

    def residual(self, values: Array) -> Array:
        """P D values, shape (n,): what a smoother of these values leaves over."""

    def precision(self) -> Array:
        """P itself, shape (n, n)."""


@dataclass(frozen=True)
class RegularisableKernel:
    """A kernel matrix, factorised once, to be regularised by many diagonals."""

    matrix: Array
    root: Array | None

    def regularise(self, weights: Array) -> Ridge:
        """The ridge for D = 1/weights, weights (n,) > 0. Raises LinAlgError if it is not positive definite."""
        if self.root is None:
            return _DenseRidge.of(self.matrix, weights)
        return _LowRankRidge.of(self.root, weights)


def factorise(matrix: Array) -> RegularisableKernel:
    """A kernel matrix (n, n) with its root (r, n), matrix = root' root, where the rank r is low."""
    n = len(matrix)
    if n < _SMALLEST_FACTORISED:
        return RegularisableKernel(matrix, None)
    factor, pivots, rank, _ = lapack.dpstrf(matrix.T, tol=_DROPPED * matrix[0, 0], lower=1)
    if rank > _LARGEST_SHARE * n:
        return RegularisableKernel(matrix, None)
    root = np.empty((rank, n))
    root[:, pivots - 1] = np.tril(factor[:, :rank]).T
    return RegularisableKernel(matrix, root)


def cholesky_in_place(matrix: Array) -> Array:
    """Lower Cholesky factor in the memory of a symmetric C-ordered matrix, itself in Fortran order.

    Raises LinAlgError where the matrix is not positive definite.
    """
    factor, info = lapack.dpotrf(matrix.T, lower=1, clean=1, overwrite_a=1)
    # Whether LAPACK notices a NaN depends on where it stands.
    if info != 0 or not np.isfinite(factor[-1, -1]):
        raise LinAlgError(f"matrix of {len(matrix)} rows is not positive definite")
    return np.asarray(factor)


@dataclass(frozen=True)
class _LowRankRidge:
    weights: Array
    log_determinant: float
    shrunk_root: Array  # T (r, n) with K - K P K = T'T

    @classmethod
    def of(cls, root: Array, weights: Array) -> _LowRankRidge:
        weighted = root * np.sqrt(weights)
        inner = weighted @ weighted.T
        inner.flat[:: len(inner) + 1] += 1.0
        factor = cholesky_in_place(inner)
        # T' L' = root' solved from the right, so that LAPACK's columns are our rows
        shrunk = blas.dtrsm(1.0, factor, root.T, side=1, lower=1, trans_a=1).T
        return cls(weights, _log_determinant(factor), shrunk)

    @property
    def posterior_diagonal(self) -> Array:
        return np.asarray(np.einsum("ij,ij->j", self.shrunk_root, self.shrunk_root))

    def residual(self, values: Array) -> Array:
        return values - (self.shrunk_root @ values) @ self.shrunk_root * self.weights

    def precision(self) -> Array:
        weighted = self.shrunk_root * self.weights
        matrix = weighted.T @ weighted
        np.negative(matrix, out=matrix)
        matrix.flat[:: len(matrix) + 1] += self.weights
        return matrix


@dataclass(frozen=True)
class _DenseRidge:
    weights: Array
    log_determinant: float
    inverse_root: Array  # L^-1 of L L' = I + w^1/2 K w^1/2

    @classmethod
    def of(cls, matrix: Array, weights: Array) -> _DenseRidge:
        scale = np.sqrt(weights)
        inner = matrix * scale
        inner *= scale[:, None]
        inner.flat[:: len(inner) + 1] += 1.0
        factor = cholesky_in_place(inner)
        log_determinant = _log_determinant(factor)
        inverse, _ = lapack.dtrtri(factor, lower=1, overwrite_c=1)
        return cls(weights, log_determinant, inverse)

    @property
    def posterior_diagonal(self) -> Array:
        explained = np.einsum("ij,ij->j", self.inverse_root, self.inverse_root)
        return np.asarray((1.0 - explained) / self.weights)

    def residual(self, values: Array) -> Array:
        scale = np.sqrt(self.weights)
        return scale * (self.inverse_root.T @ (self.inverse_root @ (values / scale)))

    def precision(self) -> Array:
        scaled = self.inverse_root * np.sqrt(self.weights)
        return scaled.T @ scaled


def _log_determinant(factor: Array) -> float:
    return 2.0 * float(np.log(np.diagonal(factor)).sum())
