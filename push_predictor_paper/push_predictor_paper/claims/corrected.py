"""Intervals for a claim that asks several of them at once."""

from __future__ import annotations

from scipy.stats import norm

from push_predictor_paper.estimate import Estimate


def corrected(estimate: Estimate, count: int) -> Estimate:
    """A 95 % interval as wide as one of `count` must be for all of them to hold together in 95 % (Bonferroni).

    Both ends move out from the figure as a normal distribution's would.
    """
    wider = float(norm.ppf(1.0 - 0.025 / count) / norm.ppf(0.975))
    low, high = (estimate.value + wider * (end - estimate.value) for end in (estimate.low, estimate.high))
    return Estimate(estimate.value, low, high)
