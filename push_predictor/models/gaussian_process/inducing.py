# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A kernel between n rows projected on m inducing inputs Z: Q = K_XZ (K_ZZ + jitter)^-1 K_ZX, never formed.

    Q = V V',  V = K_XZ L^-T (n, m),  L L' = K_ZZ + jitter;      unexplained by Z: k(x, x) - Q_xx >= 0

Everything costs O(n m^2) and goes over the rows in blocks: apart from V nothing larger than (n,) or (m, m) is kept.
The jitter only makes Z explain a little less, so a bound computed with Q is still a bound.

Z are rows of the inputs, each the one with the largest conditional variance given those before: a pivoted Cholesky
factorisation of the kernel matrix ("greedy conditional variance" of Burt, Rasmussen and van der Wilk 2020, "Convergence
of sparse variational inference in Gaussian processes regression").
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.models.gaussian_process.ridge import DenseKernel, cholesky_in_place
from push_predictor.types import Array, IntArray

_BLOCK = 2048
_JITTER = 1e-9  # of the kernel's variance
_CANDIDATES = 10_000
_NOTHING = 1e-9  # of the prior variance, a thousandth of the jitter of f
_NEGLIGIBLE = 1e-6  # of the prior variance; with a smaller conditional variance one more inducing input adds nothing


def inducing_rows(kernel: ArdKernel, inputs: Array, most: int) -> IntArray:
    """At most `most` rows of inputs (n, D), in their order; fewer if these determine all others.

    They depend on the kernel's hyperparameters. Of many rows a random choice, always the same, is searched.
    """
    candidates = np.sort(np.random.default_rng(0).permutation(len(inputs))[:_CANDIDATES])
    found = inputs[candidates]
    most = min(most, len(found))
    unknown, root, chosen = np.full(len(found), kernel.variance), np.empty((most, len(found))), []
    for k in range(most):
        row = int(np.argmax(unknown))
        if unknown[row] < _NEGLIGIBLE * kernel.variance:
            break
        known = kernel.cross(found[row : row + 1], found)[0] - root[:k, row] @ root[:k]
        root[k] = known / np.sqrt(unknown[row])
        unknown = np.maximum(unknown - root[k] ** 2, 0.0)
        unknown[row] = 0.0
        chosen.append(row)
    return np.sort(candidates[chosen])


@dataclass(frozen=True, eq=False)
class InducedKernel:
    """Inputs (n, D); inducing Z (m, D); factor L (m, m); features V (n, m); unexplained (n,) by Z."""

    kernel: ArdKernel
    inputs: Array
    inducing: Array
    factor: Array
    features: Array
    unexplained: Array

    @classmethod
    def of(cls, kernel: ArdKernel, inputs: Array, inducing: Array) -> InducedKernel:
        """The kernel of these inputs. Raises LinAlgError if inducing inputs coincide."""
        factor = _inducing_factor(kernel, inducing)
        features = np.empty((len(inputs), len(inducing)))
        unexplained = np.empty(len(inputs))
        for rows in _blocks(len(inputs)):
            features[rows] = _whitened(factor, kernel.cross(inputs[rows], inducing))
            unexplained[rows] = kernel.variance - _squared_norms(features[rows])
        return cls(kernel, inputs, inducing, factor, features, np.maximum(unexplained, 0.0))

    def regularise(self, weights: Array) -> InducedRidge:
        """The ridge of Q for noise variances 1 / weights, weights (n,) > 0. Raises LinAlgError."""
        inner = np.eye(len(self.inducing), order="F")
        for rows in _blocks(len(weights)):
            weighted = self.features[rows] * np.sqrt(weights[rows])[:, None]
            inner = scipy.linalg.blas.dsyrk(1.0, weighted.T, beta=1.0, c=inner, lower=1, overwrite_c=1)
        inner = np.tril(inner) + np.tril(inner, -1).T
        return InducedRidge(self, weights, inner, cholesky_in_place(inner.copy()))

    def times(self, vector: Array) -> Array:
        """Q vector, shape (n,)."""
        return np.asarray(self.features @ (self.features.T @ vector))


@dataclass(frozen=True, eq=False)
class InducedRidge:
    """Quantities of P = (Q + D)^-1, D = 1 / weights, as in ridge.py. inner: I + V' W V (m, m); factor: its Cholesky."""

    induced: InducedKernel
    weights: Array
    inner: Array
    factor: Array

    @property
    def log_determinant(self) -> float:
        """Log det(I + W^1/2 Q W^1/2)."""
        return 2.0 * float(np.log(np.diagonal(self.factor)).sum())

    @cached_property
    def posterior_diagonal(self) -> Array:
        """Diagonal of Q - Q P Q, shape (n,)."""
        diagonal = np.empty(len(self.weights))
        for rows in _blocks(len(diagonal)):
            diagonal[rows] = _squared_norms(_whitened(self.factor, self.induced.features[rows].copy()))
        return diagonal

    def mean(self, values: Array) -> Array:
        """Posterior mean (m,) of the whitened inducing variables, whose prior is N(0, I), given values (n,)."""
        return np.asarray(scipy.linalg.cho_solve((self.factor, True), self.induced.features.T @ values))

    def posterior(self, weights: Array) -> InducedPosterior:
        """The posterior of the function, of weights P times its values, shape (n,): V' P = inner^-1 V' W."""
        induced = self.induced
        share, vectors = np.linalg.eigh(self.explained)
        kept = share > _NOTHING
        columns = np.column_stack([induced.features.T @ weights, vectors[:, kept] * np.sqrt(share[kept])])
        columns = scipy.linalg.blas.dtrsm(1.0, induced.factor, columns, lower=1, trans_a=1)
        known = DenseKernel(induced.kernel, induced.inducing)
        return InducedPosterior(known, columns[:, 0].copy(), np.ascontiguousarray(columns[:, 1:]))

    def residual(self, values: Array) -> Array:
        """P D values, shape (n,): the residual of a smoother of these values."""
        return np.asarray(values - self.weights * (self.induced.features @ self.mean(values)))

    @cached_property
    def explained(self) -> Array:
        """I - inner^-1 (m, m): of the whitened inducing variables' prior variance."""
        identity = np.eye(len(self.inner))
        return np.asarray(identity - scipy.linalg.cho_solve((self.factor, True), identity))

    def gradient(self, added: Array, removed: Array | None = None, weights: Array | None = None) -> Array:
        """See DenseRidge."""
        induced, kernel, features = self.induced, self.induced.kernel, self.induced.features
        vectors = np.column_stack([added] if removed is None else [added, removed])
        signs = np.array([1.0, -1.0])[: vectors.shape[1]]
        whitened = scipy.linalg.blas.dtrsm(1.0, induced.factor, features.T @ vectors, lower=1, trans_a=1)
        of_features = scipy.linalg.blas.dtrsm(1.0, induced.factor, self.explained, side=1, lower=1)
        inverse = scipy.linalg.blas.dtrsm(1.0, induced.factor, np.eye(len(self.inner)), side=1, lower=1)
        known = self.inner - np.eye(len(self.inner)) - self.explained
        gradient = np.zeros(induced.inputs.shape[1] + 1)
        for rows in _blocks(len(self.weights)):
            slopes = (self.weights[rows, None] * features[rows]) @ of_features + (vectors[rows] * signs) @ whitened.T
            if weights is not None:
                beyond = (weights - self.weights)[rows, None] * features[rows]
                known += features[rows].T @ beyond
                slopes += beyond @ inverse
            slopes *= kernel.cross(induced.inputs[rows], induced.inducing)
            gradient += kernel.cross_gradient(induced.inputs[rows], induced.inducing, slopes)
        gradient -= self._of_inducing(known, (whitened * signs) @ whitened.T)
        gradient[-1] -= kernel.variance * float((self.weights if weights is None else weights).sum())
        return gradient

    def held_out_errors(self, weights: Array, block: IntArray) -> tuple[Array, Array]:
        """As in ridge.py: P_BB^-1 = W_B^-1 + V_B C^-1 V_B', C = I + V' W V less what the block B adds to it."""
        errors, variance = np.empty(len(weights)), np.empty(len(weights))
        order = np.argsort(block, kind="stable")
        for rows in np.split(order, np.flatnonzero(np.diff(block[order])) + 1):
            known = self._covariance_without(rows)
            noise, features = 1.0 / self.weights[rows], self.induced.features[rows]
            errors[rows] = noise * weights[rows] + features @ (known @ (features.T @ weights[rows]))
            variance[rows] = noise + np.einsum("ij,ij->i", features @ known, features)
        return errors, variance

    def _covariance_without(self, rows: IntArray) -> Array:
        """C^-1 (m, m): covariance of the whitened inducing variables given all rows but these."""
        weighted = self.induced.features[rows] * np.sqrt(self.weights[rows])[:, None]
        factor = cholesky_in_place(np.ascontiguousarray(self.inner - weighted.T @ weighted))
        return np.asarray(scipy.linalg.cho_solve((factor, True), np.eye(len(factor))))

    def _of_inducing(self, known: Array, squares: Array) -> Array:
        """The part of the gradient that goes through K_ZZ, with opposite sign."""
        induced, kernel = self.induced, self.induced.kernel
        weights = scipy.linalg.blas.dtrsm(1.0, induced.factor, known, side=1, lower=1)
        weights = scipy.linalg.blas.dtrsm(1.0, induced.factor, weights, lower=1, trans_a=1) + squares
        weights = 0.25 * (weights + weights.T)
        gradient = kernel.gradient(induced.inducing, kernel.matrix(induced.inducing), weights)
        gradient[-1] += 2.0 * _JITTER * kernel.variance * float(np.trace(weights))
        return gradient


@dataclass(frozen=True, eq=False)
class InducedPosterior:
    """A function's posterior from inducing inputs Z (m, D): mean k(x, Z) weights, explained variance |k(x, Z) root|^2.

    known: the kernel between Z. weights (m,); root (m, r).
    """

    known: DenseKernel
    weights: Array
    root: Array

    def predict(self, inputs: Array) -> tuple[Array, Array]:
        """Mean and explained variance at inputs (q, D), (q,) each."""
        cross = self.known.cross(inputs)
        half = cross @ self.root
        return cross @ self.weights, np.asarray(np.einsum("ij,ij->i", half, half))

    def covariance(self, inputs: Array) -> Array:
        """Posterior covariance (q, q) between inputs (q, D)."""
        half = self.known.cross(inputs) @ self.root
        return np.asarray(self.known.kernel.matrix(inputs) - half @ half.T)


def _inducing_factor(kernel: ArdKernel, inducing: Array) -> Array:
    """L (m, m), L L' = K_ZZ + jitter. Raises LinAlgError."""
    matrix = kernel.matrix(inducing)
    matrix.flat[:: len(matrix) + 1] += _JITTER * kernel.variance
    return cholesky_in_place(matrix)


def _whitened(factor: Array, rows: Array) -> Array:
    """Rows (n, m) times L^-T, in their memory."""
    return np.asarray(scipy.linalg.blas.dtrsm(1.0, factor, rows.T, lower=1, overwrite_b=1).T)


def _blocks(n: int) -> Iterator[slice]:
    for start in range(0, n, _BLOCK):
        yield slice(start, start + _BLOCK)


def _squared_norms(rows: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", rows, rows))
