# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The likelihood of a zero-mean Gaussian process that is seen through independent noise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from push_predictor.models.gaussian_process.inducing import InducedKernel, InducedRidge
from push_predictor.models.gaussian_process.ridge import DenseKernel, DenseRidge
from push_predictor.types import Array

Kernel: TypeAlias = DenseKernel | InducedKernel
Ridge: TypeAlias = DenseRidge | InducedRidge


@dataclass(frozen=True, eq=False)
class Likelihood:
    """log N(y | 0, K + D) - 1/2 sum_i unexplained_i / D_i, and its derivatives."""

    kernel: Kernel
    ridge: Ridge
    alpha: Array  # (K + D)^-1 y
    value: float

    @classmethod
    def of(cls, kernel: Kernel, outputs: Array, noise: Array) -> Likelihood:
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
