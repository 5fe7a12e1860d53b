# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Sums over many parts of a stream at once."""

from __future__ import annotations

import numpy as np

from push_predictor.types import Array, IntArray


def part_rows(first: IntArray, last: IntArray) -> IntArray:
    """The indices from each first to before each last, one after the other."""
    count = last - first
    return np.asarray(np.arange(int(count.sum())) + np.repeat(first - np.cumsum(count) + count, count))


def part_means(values: Array, count: IntArray) -> Array:
    """Means (n, k) of n consecutive parts of values (m, k), each of `count` (n,) > 0 rows."""
    return np.asarray(np.add.reduceat(values, np.cumsum(count) - count, axis=0) / count[:, None])
