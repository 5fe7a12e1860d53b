# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Intervals over seeds, in addition to the library's intervals by push."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import t as student

from push_predictor.evaluation.estimate import (
    Estimate,
    Figure,
    by_push,
    difference_by_push,
    of_draws,
    total_exact_nlpd,
    total_nlpd,
    total_nmse,
)

__all__ = [
    "Estimate",
    "Figure",
    "by_push",
    "difference_by_push",
    "of_draws",
    "over_seeds",
    "total_exact_nlpd",
    "total_nlpd",
    "total_nmse",
]


def over_seeds(values: Sequence[float]) -> Estimate:
    """Mean of a figure over seeds or folds, with Student's interval of that mean."""
    mean, count = float(np.mean(values)), len(values)
    if count < 2:
        return Estimate(mean, np.nan, np.nan)
    half = float(student.ppf(0.975, count - 1) * np.std(values, ddof=1) / np.sqrt(count))
    return Estimate(mean, mean - half, mean + half)
