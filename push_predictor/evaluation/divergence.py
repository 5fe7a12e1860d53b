"""Kullback-Leibler divergence of Gaussians: how far a model's distribution is from that of repeated pushes, nats."""

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
    """What of `gaussian_kl` comes of the distance of the means; the rest comes of the deviations."""
    return np.asarray(0.5 * ((mean - model_mean) / model_sd) ** 2)


def printed_kl(mean: Array, sd: Array, model_mean: Array, model_sd: Array) -> Array:
    """The same by the formula printed in Bauza and Rodriguez 2017, section VI: its log term is half what it should be.

    It is no divergence: it is negative, -0.077 at the least, where the model is right but 1.4 times as wide.
    """
    return gaussian_kl(mean, sd, model_mean, model_sd) - 0.5 * np.log(model_sd / sd)


def expected_kl(count: int, model_count: int | None = None) -> float:
    """What the truth itself scores on average: KL of mean and sd (ddof 1) of `count` > 1 draws of a Gaussian from it.

    model_count > 3: the model knows the truth no better than by mean and sd of so many other draws.
    """
    freedom = 0.5 * (count - 1)
    known = np.log(freedom) - digamma(freedom)
    if model_count is None:
        return 0.5 * float(known + 1.0 / count)
    model_freedom = 0.5 * (model_count - 1)
    shrunk = model_freedom / (model_freedom - 1.0)  # E[sigma^2 / model_sd^2]
    log_ratio = digamma(model_freedom) - np.log(model_freedom) + known
    return 0.5 * float(log_ratio + shrunk * (1.0 + 1.0 / count + 1.0 / model_count) - 1.0)
