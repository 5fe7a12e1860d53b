# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A kernel matrix K regularised by a positive diagonal D, as both Gaussian processes of a VHGP need it.

With w = 1/D, every quantity here belongs to the posterior of a function with prior covariance K that is seen
through noise of variance D. All of them follow from one triangular matrix, L^-1 of L L' = I + w^1/2 K w^1/2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import scipy

from push_predictor.models.gaussian_process.kernels import ArdKernel, mirror_upper
from push_predictor.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class DenseKernel:
    """A kernel between inputs (n, D), to be regularised by many diagonals.

    unexplained: prior variance of the function that K lacks.
    """

    kernel: ArdKernel
    inputs: Array
    unexplained: ClassVar[float] = 0.0

    @cached_property
    def matrix(self) -> Array:
        """K (n, n)."""
        return self.kernel.matrix(self.inputs)

    def free_matrix(self) -> None:
        """Free the matrix, which is computed again where it is needed."""
        self.__dict__.pop("matrix", None)  # a cached property

    def regularise(self, weights: Array) -> DenseRidge:
        """The ridge for D = 1/weights, weights (n,) > 0. Raises LinAlgError if it is not positive definite."""
        return DenseRidge.of(self, weights)

    def times(self, vector: Array) -> Array:
        """K vector, shape (n,)."""
        return np.asarray(self.matrix @ vector)

    def cross(self, inputs: Array) -> Array:
        """Kernel between inputs (q, D) and these, (q, n)."""
        return self.kernel.between(self.kernel.scaled(inputs), self._scaled)

    @cached_property
    def _scaled(self) -> Array:
        return np.asfortranarray(self.kernel.scaled(self.inputs))


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
class DenseRidge:
    """Quantities of P = (K + D)^-1 with D = 1/w: weights w (n,), log_determinant of I + w^1/2 K w^1/2."""

    of_kernel: DenseKernel
    weights: Array
    log_determinant: float
    inverse_root: Array  # L^-1 (n, n)

    @classmethod
    def of(cls, kernel: DenseKernel, weights: Array) -> DenseRidge:
        """Raises LinAlgError if K + D is not positive definite."""
        scale = np.sqrt(weights)
        inner = kernel.matrix * scale
        inner *= scale[:, None]
        inner.flat[:: len(inner) + 1] += 1.0
        factor = cholesky_in_place(inner)
        log_determinant = 2.0 * float(np.log(np.diagonal(factor)).sum())
        inverse, _ = scipy.linalg.lapack.dtrtri(factor, lower=1, overwrite_c=1)
        return cls(kernel, weights, log_determinant, inverse)

    @cached_property
    def _scale(self) -> Array:
        return np.asarray(np.sqrt(self.weights))

    @cached_property
    def posterior_diagonal(self) -> Array:
        """Diagonal of K - K P K, shape (n,)."""
        explained = np.einsum("ij,ij->j", self.inverse_root, self.inverse_root)
        return np.asarray((1.0 - explained) / self.weights)

    def residual(self, values: Array) -> Array:
        """P D values, shape (n,): the residual of a smoother of these values."""
        half = scipy.linalg.blas.dtrmv(self.inverse_root, values / self._scale, lower=1)
        return np.asarray(self._scale * scipy.linalg.blas.dtrmv(self.inverse_root, half, lower=1, trans=1))

    def explained(self, cross: Array) -> Array:
        """H (n, m), H'H = cross P cross': what n values explain of the prior covariance of m others; cross (m, n)."""
        scaled = cross * self._scale
        if len(cross) == 1:
            return np.asarray(scipy.linalg.blas.dtrmv(self.inverse_root, scaled[0], lower=1)[:, None])
        return np.asarray(scipy.linalg.blas.dtrmm(1.0, self.inverse_root, scaled.T, lower=1))

    def posterior(self, weights: Array) -> DensePosterior:
        """The posterior of the function, of weights P times its values, shape (n,)."""
        return DensePosterior(self, weights)

    def upper_precision(self) -> Array:
        """P in the upper triangle of a C-ordered matrix (n, n), whose other elements have no meaning."""
        # L'L in Fortran's lower triangle, for a sixth of a product's operations.
        matrix, _ = scipy.linalg.lapack.dlauum(self.inverse_root, lower=1)
        matrix *= self._scale
        matrix *= self._scale[:, None]
        return np.asarray(matrix.T)

    def precision(self) -> Array:
        """P itself, shape (n, n)."""
        return mirror_upper(self.upper_precision())

    def gradient(self, added: Array, removed: Array | None = None, weights: Array | None = None) -> Array:
        """1/2 tr((added added' - removed removed' - P) dK) - 1/2 sum weights d(unexplained), vectors (n,).

        d is by the kernel's log_lengthscales and log_sd, shape (D + 1,). weights: w if not given. A dense kernel leaves
        nothing unexplained.
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
        for rows in rows_of_blocks(block):
            covariance = np.linalg.inv(precision[rows[:, :, None], rows[:, None, :]])
            errors[rows] = (covariance @ weights[rows][:, :, None])[:, :, 0]
            variance[rows] = np.diagonal(covariance, axis1=1, axis2=2)
        return errors, variance


def rows_of_blocks(block: IntArray) -> list[IntArray]:
    """Rows (b, k) of the blocks (n,) of k rows, for each k: equal blocks are computed together."""
    order = np.argsort(block, kind="stable")
    _, starts, sizes = np.unique(block[order], return_index=True, return_counts=True)
    return [order[starts[sizes == size, None] + np.arange(size)] for size in np.unique(sizes)]


@dataclass(frozen=True, eq=False)
class DensePosterior:
    """A function's posterior from all training rows: mean k(x, X) weights, explained variance k(x, X) P k(X, x).

    weights (n,): P times the values.
    """

    ridge: DenseRidge
    weights: Array

    def predict(self, inputs: Array) -> tuple[Array, Array]:
        """Mean and explained variance at inputs (q, D), (q,) each."""
        cross = self.ridge.of_kernel.cross(inputs)
        half = self.ridge.explained(cross)
        return cross @ self.weights, np.asarray(np.einsum("ij,ij->j", half, half))

    def covariance(self, inputs: Array) -> Array:
        """Posterior covariance (q, q) between inputs (q, D)."""
        known = self.ridge.of_kernel
        half = self.ridge.explained(known.cross(inputs))
        return np.asarray(known.kernel.matrix(inputs) - half.T @ half)
