"""What a regressor of this package says about one output at m inputs."""

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
        """E[exp(g)], the variance that the process itself has, shape (m,)."""
        return np.asarray(np.exp(self.log_noise_mean + 0.5 * self.log_noise_variance))

    @property
    def outcome_variance(self) -> Array:
        """Variance of an observed outcome: what the process scatters and what the model is unsure of, (m,)."""
        return self.variance + self.process_variance
