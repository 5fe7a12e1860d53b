# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Intervals for a claim that tests several of them at once."""

from __future__ import annotations

from scipy.stats import norm

from push_predictor_paper.estimate import Estimate


def corrected(estimate: Estimate, count: int) -> Estimate:
    """Widen a 95 % interval so that `count` of them jointly cover with at least 95 % (Bonferroni).

    Both ends move away from the value as those of a normal distribution do.
    """
    wider = float(norm.ppf(1.0 - 0.025 / count) / norm.ppf(0.975))
    low, high = (estimate.value + wider * (end - estimate.value) for end in (estimate.low, estimate.high))
    return Estimate(estimate.value, low, high)
