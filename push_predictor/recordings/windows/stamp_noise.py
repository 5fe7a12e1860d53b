# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0
"""Noise of stamps: its estimate, and the samples that are missing in the regular grid that the noise hides.

Stamps taken at receipt have jitter: a sample at a regular time has a stamp some milliseconds off. regular_stamps.py
replaces such stamps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.types import Array, IntArray

SHARE = 0.05  # of the period: less jitter stays, as a window hardly feels it
LEAST = 0.9e-3  # s; less jitter stays: it moves a tip at 50 mm/s by no more than a tracker's noise
LARGEST_SHARE = 1.0  # of the period: with more, the order of samples is lost
FEWEST = 10  # stamps from which jitter is estimated
DECIDING = 101  # stamps that decide whether a stream has noise
SD = 1.4826  # standard deviations of a Gaussian in one median absolute deviation
CORRELATION = -0.3  # of consecutive intervals, above which a stream has no regular grid
MOST_WIDTH = 40  # samples whose mean shows a missing sample
POWER = 400.0  # half a period is over four standard deviations of the excess step between means of `width` samples
LIMIT = 4.0  # jitters by which an interval deviates at most


@dataclass(frozen=True)
class StampNoise:
    """Usual interval and jitter, the standard deviation of a stamp, in s; corrected: whether stamps are replaced."""

    period: float
    jitter: float
    corrected: bool


def stamp_noise(stamp: IntArray) -> StampNoise | None:
    """The noise of stamps (n,) in ns, in order of arrival; None for too few. Robust to gaps and missing samples."""
    interval = np.diff(stamp) * NANOSECOND
    if len(stamp) < FEWEST or not np.any(interval > 0.0):
        return None
    usual = float(np.median(interval[interval > 0.0]))
    # The median ignores gaps. An interval has the noise of two stamps.
    jitter = float(SD * np.median(np.abs(interval - usual)) / np.sqrt(2.0))
    large = max(SHARE * usual, LEAST) < jitter <= LARGEST_SHARE * usual
    return StampNoise(usual, jitter, bool(large and _is_regular(interval - usual, LIMIT * jitter)))


def _is_regular(deviation: Array, limit: float) -> bool:
    """Whether the samples are of a grid: a late stamp makes its interval longer and the next one as much shorter.

    deviation (n,): of the intervals, s, limited to `limit`, so that gaps do not decide. The correlation of consecutive
    ones is -0.5 for noisy stamps of a grid, and 0 for exact stamps at irregular times.
    """
    deviation = np.clip(deviation, -limit, limit)
    deviation = deviation - deviation.mean()
    return float(deviation[1:] @ deviation[:-1]) < CORRELATION * float(deviation @ deviation)


def width(noise: StampNoise) -> int:
    """Samples whose mean shows a missing one."""
    share = noise.jitter / noise.period
    return int(np.clip(np.ceil(POWER * share**2), 3, MOST_WIDTH))


def missing_before(stamp: IntArray, noise: StampNoise) -> IntArray:
    """How many samples of the grid are missing before each of n samples with stamps (n,) in ns.

    A missing sample makes all later stamps a period later: the step from the mean of `width` stamps to that of the next
    exceeds the steps next to it. Zero for the first and last two widths, and where a larger step is within a width.
    """
    w, n = width(noise), len(stamp)
    found = np.zeros(n, np.int64)
    if n < 4 * w + 1:
        return found
    sums = np.concatenate([[0], np.cumsum(stamp - stamp[0])])  # of integers, so that their rounding depends on nothing
    means = sums[w:] - sums[:-w]  # of `width` stamps from each on, times the width
    step = means[w:] - means[:-w]  # at a place w later
    excess = 2 * step[w:-w] - step[: -2 * w] - step[2 * w :]  # at a place 2 w later, times twice the width
    largest = sliding_window_view(np.pad(excess, w, constant_values=np.iinfo(np.int64).min), 2 * w + 1).max(axis=1)
    count = np.rint(excess * NANOSECOND / (2 * w * noise.period)).astype(np.int64)
    peak = (excess == largest) & (count > 0)
    found[2 * w : 2 * w + len(excess)] = np.where(peak, count, 0)
    return found
