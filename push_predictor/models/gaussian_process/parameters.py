# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The hyperparameters of a VHGP."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.models.gaussian_process.kernels import ArdKernel
from push_predictor.types import Array

JITTER = 1e-6  # of the signal variance, on the diagonal of K_f


@dataclass(frozen=True)
class VhgpParameters:
    """Hyperparameters: ARD kernel of the signal f, ARD kernel of the log noise variance g, prior mean of g.

    log_nugget_sd: log of the standard deviation of g's nugget, which is independent from row to row.
    """

    log_lengthscales: Array
    log_signal_sd: float
    noise_log_lengthscales: Array
    noise_log_sd: float
    noise_mean: float
    log_nugget_sd: float

    @property
    def count(self) -> int:
        """Number of hyperparameters."""
        return 2 * len(self.log_lengthscales) + 4

    @property
    def signal(self) -> ArdKernel:
        """Kernel of f."""
        return ArdKernel(self.log_lengthscales, self.log_signal_sd)

    @property
    def noise(self) -> ArdKernel:
        """Kernel of g, without its nugget."""
        return ArdKernel(self.noise_log_lengthscales, self.noise_log_sd)

    @property
    def nugget(self) -> float:
        """What is added to the diagonal of K_g, and to the variance of g at any input."""
        return float(np.exp(2.0 * self.log_nugget_sd))

    @property
    def jitter(self) -> float:
        """What is added to the diagonal of K_f."""
        return JITTER * self.signal.variance

    def to_vector(self) -> Array:
        """The numbers in their order, shape (2 D + 4,)."""
        signal = np.append(self.log_lengthscales, self.log_signal_sd)
        rest = [self.noise_log_sd, self.noise_mean, self.log_nugget_sd]
        return np.concatenate([signal, self.noise_log_lengthscales, rest])

    @classmethod
    def from_vector(cls, vector: Array) -> VhgpParameters:
        """The inverse of `to_vector`."""
        d = (len(vector) - 4) // 2
        return cls(vector[:d], float(vector[d]), vector[d + 1 : -3], *(float(value) for value in vector[-3:]))
