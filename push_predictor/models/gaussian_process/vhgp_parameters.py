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

"""The hyperparameters of a VHGP."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.models.gaussian_process.kernels import (
    DEFAULT_CHOICE,
    ArdKernel,
    KernelChoice,
    KernelFamily,
    ard_kernel,
)
from push_predictor.types import Array

JITTER = 1e-6  # of the signal variance, on the diagonal of K_f


@dataclass(frozen=True)
class VhgpParameters:
    """Hyperparameters: ARD kernel of the signal f, ARD kernel of the log noise variance g, prior mean of g.

    log_nugget_sd: log of the standard deviation of g's nugget, which is independent from row to row; None if absent.
    """

    log_lengthscales: Array
    log_signal_sd: float
    noise_log_lengthscales: Array
    noise_log_sd: float
    noise_mean: float
    family: KernelFamily = "squared_exponential"
    log_nugget_sd: float | None = None

    @property
    def choice(self) -> KernelChoice:
        """The kernels that these are hyperparameters of."""
        return KernelChoice(self.family, self.log_nugget_sd is not None)

    @property
    def count(self) -> int:
        """Number of hyperparameters."""
        return len(self.to_vector())

    @property
    def signal(self) -> ArdKernel:
        """Kernel of f."""
        return ard_kernel(self.family, self.log_lengthscales, self.log_signal_sd)

    @property
    def noise(self) -> ArdKernel:
        """Kernel of g, without its nugget."""
        return ard_kernel(self.family, self.noise_log_lengthscales, self.noise_log_sd)

    @property
    def nugget(self) -> float:
        """What is added to the diagonal of K_g, and to the variance of g at any input."""
        return 0.0 if self.log_nugget_sd is None else float(np.exp(2.0 * self.log_nugget_sd))

    @property
    def jitter(self) -> float:
        """What is added to the diagonal of K_f."""
        return JITTER * self.signal.variance

    def to_vector(self) -> Array:
        """The numbers in their order, shape (2 D + 3,), or (2 D + 4,) with a nugget."""
        signal = np.append(self.log_lengthscales, self.log_signal_sd)
        nugget = [] if self.log_nugget_sd is None else [self.log_nugget_sd]
        return np.concatenate([signal, self.noise_log_lengthscales, [self.noise_log_sd, self.noise_mean], nugget])

    @classmethod
    def from_vector(cls, vector: Array, choice: KernelChoice = DEFAULT_CHOICE) -> VhgpParameters:
        """The inverse of `to_vector`."""
        nugget = float(vector[-1]) if choice.noise_nugget else None
        d = (len(vector) - 3) // 2
        noise_sd, noise_mean = float(vector[2 * d + 1]), float(vector[2 * d + 2])
        return cls(vector[:d], float(vector[d]), vector[d + 1 : 2 * d + 1], noise_sd, noise_mean, choice.family, nugget)
