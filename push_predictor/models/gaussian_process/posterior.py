# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A zero-mean Gaussian process seen through independent noise: its likelihood, and its posterior at new inputs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from push_predictor.models.gaussian_process.ridge import Regularisable, Ridge, cholesky_in_place
from push_predictor.types import Array


class KernelPosterior:
    """Posterior for a kernel matrix (n, n) between training inputs and noise variances (n,), any kernel.

    After construction a prediction costs one triangular solve. Raises numpy's LinAlgError when the kernel
    matrix plus noise is not positive definite.
    """

    def __init__(self, kernel_matrix: Array, noise_variances: Array) -> None:
        regularised = np.array(kernel_matrix, order="C")
        regularised.flat[:: len(regularised) + 1] += noise_variances
        self._factor = cholesky_in_place(regularised)

    def weights(self, values: Array) -> Array:
        """(K + noise)^-1 values, shape (n,): the posterior mean at x* is k(x*, X) times this."""
        half = scipy.linalg.blas.dtrsv(self._factor, values, lower=1)
        return np.asarray(scipy.linalg.blas.dtrsv(self._factor, half, lower=1, trans=1))

    def explained_variance(self, cross: Array) -> Array:
        """By how much the observations reduce the prior variance at m inputs, shape (m,).

        cross (m, n): kernel between the new inputs and the training inputs. The result is
        diag(cross (K + noise)^-1 cross').
        """
        if len(cross) == 1:
            half = scipy.linalg.blas.dtrsv(self._factor, cross[0], lower=1)
            return np.array([half @ half])
        half = scipy.linalg.blas.dtrsm(1.0, self._factor, cross.T, lower=1)
        return np.asarray(np.einsum("ij,ij->j", half, half))

    def explained_covariance(self, cross: Array) -> Array:
        """By how much the observations reduce the prior covariance between m inputs, (m, m); cross (m, n) as above."""
        half = scipy.linalg.blas.dtrsm(1.0, self._factor, cross.T, lower=1)
        return np.asarray(half.T @ half)


@dataclass(frozen=True, eq=False)
class Likelihood:
    """log N(y | 0, K + D) - 1/2 sum_i unexplained_i / D_i, and its derivatives."""

    kernel: Regularisable
    ridge: Ridge
    alpha: Array  # (K + D)^-1 y
    value: float

    @classmethod
    def of(cls, kernel: Regularisable, outputs: Array, noise: Array) -> Likelihood:
        """For outputs y (n,) and noise variances D (n,). Raises LinAlgError."""
        weights = 1.0 / noise
        ridge = kernel.regularise(weights)
        alpha = ridge.residual(weights * outputs)
        fit = outputs @ alpha + ridge.log_determinant + np.log(2.0 * np.pi * noise).sum()
        return cls(kernel, ridge, alpha, -0.5 * float(fit + (weights * kernel.unexplained).sum()))

    @cached_property
    def slopes(self) -> Array:
        """Derivative of the value by D, shape (n,)."""
        weights, uncertainty = self.ridge.weights, self.ridge.posterior_diagonal + self.kernel.unexplained
        return np.asarray(0.5 * (self.alpha**2 - weights + uncertainty * weights**2))

    def gradient(self) -> Array:
        """Derivative of the value by (log_lengthscales, log_sd) of the kernel at fixed D, shape (D + 1,)."""
        return self.ridge.gradient(self.alpha)
