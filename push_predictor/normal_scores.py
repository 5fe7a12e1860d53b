# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Normal scores: values replaced by normal quantiles of their ranks."""

from __future__ import annotations

import numpy as np
import scipy

from push_predictor.types import Array


def normal_scores(values: Array) -> Array:
    """Normal quantiles ndtri((rank - 1/2) / n) of the ranks in each column.

    values: (n, ...); the result has the same shape. Equal values share the mean of their ranks. A column that contains
    NaN gets NaN scores.
    """
    return np.asarray(scipy.special.ndtri(np.apply_along_axis(_shares, 0, values)))


def _shares(column: Array) -> Array:
    """(rank - 1/2) / n. scipy.stats.rankdata does the same, but its import takes every node 0.4 s."""
    if np.isnan(column).any():
        return np.full(len(column), np.nan)
    ordered = np.sort(column)
    below, upto = np.searchsorted(ordered, column, "left"), np.searchsorted(ordered, column, "right")
    return np.asarray(0.5 * (below + upto) / len(column))
