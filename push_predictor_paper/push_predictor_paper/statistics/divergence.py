# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Kullback-Leibler (KL) divergence of Gaussians, nats: from repeated pushes to a model's prediction."""

from __future__ import annotations

import numpy as np
from scipy.special import digamma

from push_predictor.types import Array


def gaussian_kl(mean: Array, sd: Array, model_mean: Array, model_sd: Array) -> Array:
    """KL(N(mean, sd^2) || N(model_mean, model_sd^2)) elementwise, nats, 0 where they agree; shapes broadcast.

    mean and model_mean in one unit, which drops out; sd and model_sd > 0 in the same.
    """
    ratio = (sd / model_sd) ** 2
    return 0.5 * (ratio - 1.0 - np.log(ratio)) + kl_of_mean(mean, model_mean, model_sd)


def kl_of_mean(mean: Array, model_mean: Array, model_sd: Array) -> Array:
    """The part of `gaussian_kl` due to the difference of the means; the rest is due to the standard deviations."""
    return np.asarray(0.5 * ((mean - model_mean) / model_sd) ** 2)


def printed_kl(mean: Array, sd: Array, model_mean: Array, model_sd: Array) -> Array:
    """The KL divergence as printed in Bauza and Rodriguez 2017, section VI, where the log term is half too small.

    It is not a divergence: for a correct model with 1.4 times the standard deviation it reaches its minimum of -0.077.
    """
    return gaussian_kl(mean, sd, model_mean, model_sd) - 0.5 * np.log(model_sd / sd)


def expected_kl(count: int, model_count: int | None = None) -> float:
    """Expected KL divergence of a correct model: from mean and sd (ddof 1) of `count` > 1 samples to the true Gaussian.

    model_count > 3: the model is itself estimated from that many other samples.
    """
    freedom = 0.5 * (count - 1)
    known = np.log(freedom) - digamma(freedom)
    if model_count is None:
        return 0.5 * float(known + 1.0 / count)
    model_freedom = 0.5 * (model_count - 1)
    shrunk = model_freedom / (model_freedom - 1.0)  # E[sigma^2 / model_sd^2]
    log_ratio = digamma(model_freedom) - np.log(model_freedom) + known
    return 0.5 * float(log_ratio + shrunk * (1.0 + 1.0 / count + 1.0 / model_count) - 1.0)
