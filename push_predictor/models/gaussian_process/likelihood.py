# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The likelihood of a zero-mean Gaussian process that is seen through independent noise; kernels with a nugget."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from push_predictor.models.gaussian_process.inducing import InducedKernel, InducedRidge
from push_predictor.models.gaussian_process.ridge import DenseKernel, DenseRidge
from push_predictor.types import Array, IntArray

SmoothKernel: TypeAlias = DenseKernel | InducedKernel
SmoothRidge: TypeAlias = DenseRidge | InducedRidge


@dataclass(frozen=True, eq=False)
class NuggetKernel:
    """K + nugget times the identity. The nugget is kept separate, because with it no matrix has low rank."""

    smooth: SmoothKernel
    nugget: float

    @property
    def unexplained(self) -> Array | float:
        """See DenseKernel."""
        return self.smooth.unexplained

    def regularise(self, weights: Array) -> NuggetRidge:
        """See DenseKernel."""
        return NuggetRidge(self.nugget, weights, self.smooth.regularise(weights / (1.0 + self.nugget * weights)))

    def times(self, vector: Array) -> Array:
        """See DenseKernel."""
        return self.smooth.times(vector) + self.nugget * vector


@dataclass(frozen=True, eq=False)
class NuggetRidge:
    """See DenseRidge; P is that of K without the nugget and D + nugget in place of D."""

    nugget: float
    weights: Array
    smooth: SmoothRidge

    @property
    def share(self) -> Array:
        """D / (D + nugget), shape (n,)."""
        return self.smooth.weights / self.weights

    @property
    def log_determinant(self) -> float:
        """See DenseRidge."""
        return self.smooth.log_determinant - float(np.log(self.share).sum())

    @property
    def posterior_diagonal(self) -> Array:
        """See DenseRidge."""
        return self.share * (self.nugget + self.share * self.smooth.posterior_diagonal)

    def residual(self, values: Array) -> Array:
        """See DenseRidge."""
        return self.smooth.residual(self.share * values)

    def gradient(self, added: Array, removed: Array | None = None, weights: Array | None = None) -> Array:
        """See DenseRidge."""
        of_smooth = self.smooth.gradient(added, removed, self.weights if weights is None else weights)
        squares = added**2 if removed is None else added**2 - removed**2
        precision = self.smooth.weights - self.smooth.posterior_diagonal * self.smooth.weights**2
        return np.append(of_smooth, self.nugget * float((squares - precision).sum()))

    def held_out_errors(self, weights: Array, block: IntArray) -> tuple[Array, Array]:
        """See DenseRidge."""
        return self.smooth.held_out_errors(weights, block)


@dataclass(frozen=True, eq=False)
class Likelihood:
    """log N(y | 0, K + D) - 1/2 sum_i unexplained_i / D_i, and its derivatives."""

    kernel: SmoothKernel
    ridge: SmoothRidge
    alpha: Array  # (K + D)^-1 y
    value: float

    @classmethod
    def of(cls, kernel: SmoothKernel, outputs: Array, noise: Array) -> Likelihood:
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
