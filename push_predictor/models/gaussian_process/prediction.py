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

"""The prediction of one output at m inputs, before noise and function are combined."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array


@dataclass(frozen=True)
class LatentPrediction:
    """f ~ N(mean, variance) and the log noise variance g ~ N(log_noise_mean, log_noise_variance), each (m,).

    The outcome is y ~ N(f, exp(g)). A homoscedastic process has log_noise_variance 0.
    """

    mean: Array
    variance: Array
    log_noise_mean: Array
    log_noise_variance: Array

    @property
    def process_variance(self) -> Array:
        """E[exp(g)], the variance of the process itself, shape (m,)."""
        return np.asarray(np.exp(self.log_noise_mean + 0.5 * self.log_noise_variance))

    @property
    def outcome_variance(self) -> Array:
        """Variance of an observed outcome: of the process plus that of f, (m,)."""
        return self.variance + self.process_variance
