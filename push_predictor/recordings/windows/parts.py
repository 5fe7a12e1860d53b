# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Means of, and lines through, many parts of a stream at once."""

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


def part_lines(time: Array, values: Array, count: IntArray) -> tuple[Array, Array, Array]:
    """Least-squares lines through n parts of times (m,) s and values (m, k): values (n, k) at time 0 and slopes (n, k).

    Also the mean square (n, k) of what each line leaves.
    """
    mean_time, mean = part_means(time[:, None], count), part_means(values, count)
    late, off = time[:, None] - np.repeat(mean_time, count, axis=0), values - np.repeat(mean, count, axis=0)
    spread = part_means(late**2, count)
    slope = part_means(late * off, count) / np.where(spread > 0.0, spread, 1.0)
    misfit = part_means((off - np.repeat(slope, count, axis=0) * late) ** 2, count)
    return mean - slope * mean_time, slope, misfit
