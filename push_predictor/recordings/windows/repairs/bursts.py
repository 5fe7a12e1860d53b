# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Stamps of receipt in bursts, of a capture at a regular rate: some samples are held up and arrive together.

Most samples arrive soon: their stamps lie on a line over their numbers, the others above it. A low percentile of the
deviations around a sample finds the line, however long the others were held up.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.types import Array, BoolArray, IntArray

TOGETHER = 0.25  # of the period: intervals below it are of samples that arrive together
LEAST_TOGETHER = 0.1  # of the intervals
SOON = 0.2  # of the period: stamps of samples that were not held up are so near to the line
LEAST_SOON = 0.5  # of the samples
LOW = 30.0  # percentile of the deviations on the line: below the share of samples that were not held up
WIDTH = 21  # samples on either side that show a missing one


def burst_period(stamp: IntArray) -> float | None:
    """The period (s) of a capture whose stamps (n,) ns are in bursts, None if they are not, or follow no line."""
    n = len(stamp)
    if n < 2 * WIDTH:
        return None
    half = n // 2
    period = float(np.median(stamp[half:] - stamp[: n - half])) / half
    if period <= 0.0 or np.mean(np.diff(stamp) < TOGETHER * period) < LEAST_TOGETHER:
        return None
    deviation = (stamp - stamp[0]) - period * np.arange(n)
    soon = np.abs(deviation - np.percentile(deviation, LOW)) < SOON * period
    return period * NANOSECOND if np.mean(soon) >= LEAST_SOON else None


def missing_in_bursts(stamp: IntArray, period: float) -> IntArray:
    """How many samples of the grid are missing before each of n samples; zero for the first and last WIDTH."""
    n = len(stamp)
    found = np.zeros(n, np.int64)
    if n < 2 * WIDTH + 1:
        return found
    late = (stamp - stamp[0]) * NANOSECOND - period * np.arange(n)
    low = np.percentile(sliding_window_view(late, WIDTH), LOW, axis=1)
    step = low[WIDTH:] - low[:-WIDTH]  # at a place WIDTH later
    largest = sliding_window_view(np.pad(step, WIDTH, constant_values=-np.inf), 2 * WIDTH + 1).max(axis=1)
    count = np.rint(step / period).astype(np.int64)
    peak = (step == largest) & (count > 0)
    peak[1:] &= ~peak[:-1]
    found[WIDTH : WIDTH + len(step)] = np.where(peak, count, 0)
    return found


def low_of(late: Array, inside: BoolArray) -> Array:
    """The deviation (m,) of those that arrived soon, among the deviations (m, k) that are inside a run."""
    late = np.sort(np.where(inside, late, np.inf), axis=1)
    low = (0.01 * LOW * (inside.sum(axis=1) - 1)).astype(np.int64)
    return np.asarray(late[np.arange(len(late)), low])
