# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A kernel matrix K regularised by a positive diagonal D, as both Gaussian processes of a VHGP need it.

With w = 1/D, every quantity here belongs to the posterior of a function with prior covariance K that is seen
through noise of variance D. Kernel matrices of smooth functions are of low numerical rank when there are many
inputs, so K = V V' with V (n, r) from a pivoted Cholesky factorisation; the remainder, below 1e-12 of K's
diagonal, is dropped. Where the rank is not low the dense matrix is used.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import scipy

from push_predictor.models.gaussian_process.matrices.triangles import mirror_upper
from push_predictor.types import Array

_DROPPED = 1e-12
_SMALLEST_FACTORISED = 200
_LARGEST_SHARE = 0.5
_LARGEST_SHARE_OF_HALF = 0.35  # of all rows: a higher rank of every second row makes the search not worthwhile


class Ridge(Protocol):
    """Quantities of P = (K + D)^-1 with D = 1/w."""

    @property
    def log_determinant(self) -> float:
        """Log det(I + w^1/2 K w^1/2)."""

    @property
    def posterior_diagonal(self) -> Array:
        """Diagonal of K - K P K, shape (n,)."""

    def residual(self, values: Array) -> Array:
        """P D values, shape (n,): the residual of a smoother of these values."""

    def precision(self) -> Array:
        """P itself, shape (n, n)."""

    def upper_precision(self) -> Array:
        """P in the upper triangle of a C-ordered matrix (n, n), whose other elements have no meaning."""


@dataclass(frozen=True)
class RegularisableKernel:
    """K = matrix + nugget times the identity, factorised once, to be regularised by many diagonals.

    The nugget is kept separate, because with it no matrix has low rank.
    """

    matrix: Array
    root: Array | None
    nugget: float = 0.0

    def regularise(self, weights: Array) -> Ridge:
        """The ridge for D = 1/weights, weights (n,) > 0. Raises LinAlgError if it is not positive definite."""
        if self.nugget > 0.0:
            share = 1.0 / (1.0 + self.nugget * weights)
            return _NuggetRidge(self.nugget, share, replace(self, nugget=0.0).regularise(weights * share))
        if self.root is None:
            return _DenseRidge.of(self.matrix, weights)
        return _LowRankRidge.of(self.root, weights)

    def times(self, vector: Array) -> Array:
        """K vector, shape (n,)."""
        return self.matrix @ vector + self.nugget * vector


def factorise(matrix: Array, nugget: float = 0.0, *, smooth: bool = True) -> RegularisableKernel:
    """A kernel matrix (n, n) with its root (r, n), matrix = root' root, where the rank r is low.

    smooth: whether the kernel has derivatives of all orders. The rank of others is not low, so it is not searched for.
    """
    n = len(matrix)
    if n < _SMALLEST_FACTORISED or not smooth or _rank_of_half(matrix) > _LARGEST_SHARE_OF_HALF * n:
        return RegularisableKernel(matrix, None, nugget)
    factor, pivots, rank, _ = scipy.linalg.lapack.dpstrf(matrix.T, tol=_DROPPED * matrix[0, 0], lower=1)
    if rank > _LARGEST_SHARE * n:
        return RegularisableKernel(matrix, None, nugget)
    root = np.empty((rank, n))
    root[:, pivots - 1] = np.tril(factor[:, :rank]).T
    return RegularisableKernel(matrix, root, nugget)


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
        shrunk = scipy.linalg.blas.dtrsm(1.0, factor, root.T, side=1, lower=1, trans_a=1).T
        return cls(weights, _log_determinant(factor), shrunk)

    @property
    def posterior_diagonal(self) -> Array:
        return np.asarray(np.einsum("ij,ij->j", self.shrunk_root, self.shrunk_root))

    def residual(self, values: Array) -> Array:
        return values - (self.shrunk_root @ values) @ self.shrunk_root * self.weights

    def precision(self) -> Array:
        return mirror_upper(self.upper_precision())

    def upper_precision(self) -> Array:
        weighted = self.shrunk_root * self.weights
        # Fortran's lower triangle is the upper one of the C-ordered transpose.
        matrix = scipy.linalg.blas.dsyrk(-1.0, weighted.T, lower=1).T
        matrix.flat[:: len(matrix) + 1] += self.weights
        return np.asarray(matrix)


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
        inverse, _ = scipy.linalg.lapack.dtrtri(factor, lower=1, overwrite_c=1)
        return cls(weights, log_determinant, inverse)

    @property
    def posterior_diagonal(self) -> Array:
        explained = np.einsum("ij,ij->j", self.inverse_root, self.inverse_root)
        return np.asarray((1.0 - explained) / self.weights)

    def residual(self, values: Array) -> Array:
        scale = np.sqrt(self.weights)
        return scale * (self.inverse_root.T @ (self.inverse_root @ (values / scale)))

    def precision(self) -> Array:
        return mirror_upper(self.upper_precision())

    def upper_precision(self) -> Array:
        # L'L in Fortran's lower triangle, for a sixth of a product's operations.
        matrix, _ = scipy.linalg.lapack.dlauum(self.inverse_root, lower=1)
        scale = np.sqrt(self.weights)
        matrix *= scale
        matrix *= scale[:, None]
        return np.asarray(matrix.T)


@dataclass(frozen=True)
class _NuggetRidge:
    """K = K0 + nugget: P is that of K0 with D + nugget for its diagonal. share (n,) is D / (D + nugget)."""

    nugget: float
    share: Array
    inner: Ridge

    @property
    def log_determinant(self) -> float:
        return self.inner.log_determinant - float(np.log(self.share).sum())

    @property
    def posterior_diagonal(self) -> Array:
        return self.share * (self.nugget + self.share * self.inner.posterior_diagonal)

    def residual(self, values: Array) -> Array:
        return self.inner.residual(self.share * values)

    def precision(self) -> Array:
        return self.inner.precision()

    def upper_precision(self) -> Array:
        return self.inner.upper_precision()


def _log_determinant(factor: Array) -> float:
    return 2.0 * float(np.log(np.diagonal(factor)).sum())
