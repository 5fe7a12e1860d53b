# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Intervals over seeds and folds, in addition to the library's intervals by push."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import t as student

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.types import Array, IntArray


def exactly(value: float) -> Estimate:
    """A count, or another figure without uncertainty."""
    return Estimate(float(value), float(value), float(value))


def of_ends(end: Callable[..., Array], estimates: Sequence[Estimate]) -> Estimate:
    """The least (np.min) or largest (np.max) of several estimates, of values and of ends alike."""
    value, low, high = end([(e.value, e.low, e.high) for e in estimates], axis=0).tolist()
    return Estimate(value, low, high)


def over_seeds(values: Sequence[float]) -> Estimate:
    """Mean of a figure over seeds or folds, with Student's interval of that mean."""
    mean, count = float(np.mean(values)), len(values)
    if count < 2:
        return Estimate(mean, np.nan, np.nan)
    half = float(student.ppf(0.975, count - 1) * np.std(values, ddof=1) / np.sqrt(count))
    return Estimate(mean, mean - half, mean + half)


def fold_weights(push_id: np.ndarray, fold: IntArray) -> Array:
    """Weights (1 + draws, n): each row once, then resampled folds (n,) and, within them, resampled pushes (n,)."""
    drawn, (folds, number) = push_bootstrap(push_id), np.unique(fold, return_inverse=True)
    count = len(folds)
    again = np.random.default_rng(1).multinomial(count, np.full(count, 1.0 / count), size=len(drawn))
    return np.vstack([np.ones(len(push_id)), drawn * again[:, number]])
