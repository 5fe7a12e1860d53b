# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Regular stamps in place of noisy ones while samples arrive.

A window interpolates single samples, so its outcome gets the error of their stamps. Where the first samples of a stream
show jitter, each stamp is replaced by that of a line through the samples around it, over their numbers in a regular
grid. Streams with less jitter, or without a grid, keep their stamps.

Stamps of receipt may be in bursts, of a capture at a regular rate: some samples are held up and arrive together. Most
arrive soon: their stamps lie on a line over their numbers, the others above it. A low percentile of the deviations
around a sample finds the line, however long the others were held up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from push_predictor.recordings.dropouts import NANOSECOND, longest_interval
from push_predictor.recordings.streams import joined, taken
from push_predictor.recordings.windows.stamp_order import OrderedSamples, Portions
from push_predictor.types import Array, BoolArray, IntArray

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
AROUND = 50  # samples before and after one that determine its stamp
ROWS = 4096  # stamps that are fitted at once: each needs its neighbours' in memory, 1 kB a time
BURST_PERIODS = 12.0  # in which samples may be held up: a longer interval is a gap
KEPT = max(AROUND, 5 * MOST_WIDTH)  # samples that are kept before those that were not returned yet
TOGETHER = 0.25  # of the period: intervals below it are of samples that arrive together
LEAST_TOGETHER = 0.1  # of the intervals
SOON = 0.2  # of the period: stamps of samples that were not held up are so near to the line
LEAST_SOON = 0.5  # of the samples
LOW = 30.0  # percentile of the deviations on the line: below the share of samples that were not held up
WIDTH = 21  # samples on either side that show a missing one


@dataclass(frozen=True)
class StampNoise:
    """Usual interval and jitter, the standard deviation of a stamp, in s; corrected: whether stamps are replaced.

    bursts: the stamps are those of receipt, in bursts.
    """

    period: float
    jitter: float
    corrected: bool
    bursts: bool = False


class RegularStamps(Portions):
    """Takes the samples of one stream in order and returns them, with regular stamps where they have jitter.

    noise: of the last DECIDING samples before the correction began, or of the last block of them; None until it is
    known. The result does not depend on the portions. The first DECIDING samples wait for each other. With jitter a
    sample waits for AROUND others and three widths, or for a gap.
    """

    def __init__(self) -> None:
        super().__init__()  # keeps those that wait for the first decision
        self.noise: StampNoise | None = None
        self._block = np.empty(0, np.int64)  # stamps since the last decision
        self._segment: _Segment | None = None
        self._last: int | None = None  # stamp (ns) before the next, as it came

    @property
    def waiting(self) -> int:
        """How many samples wait."""
        return super().waiting + (0 if self._segment is None else self._segment.waiting)

    @property
    def corrected(self) -> bool:
        """Whether stamps are replaced."""
        return self.noise is not None and self.noise.corrected

    def take(self, new: OrderedSamples, final: bool = False) -> OrderedSamples:
        """Add samples and return those whose stamps are known; with `final` all are."""
        new, self._samples = self._with(new), None
        if self.noise is None and len(new) < DECIDING:
            if not final:
                self._keep(new, slice(None), 0)
                return taken(new, slice(0, 0))
            self.noise = stamp_noise(new.stamp)
        count = 0 if self.corrected else self._undisturbed(new.stamp)
        if self.noise is None or not self.corrected:
            return new
        regular = self._regular(taken(new, slice(count, None)), self.noise, final)
        return joined([taken(new, slice(0, count)), regular])

    def _undisturbed(self, stamp: IntArray) -> int:
        """How many of these samples come before jitter shows: that of the first block corrects this block as well."""
        known, stamps = self.noise is not None, np.concatenate([self._block, stamp])
        blocks = stamps[: len(stamps) // DECIDING * DECIDING].reshape(-1, DECIDING)
        self._block = stamps[blocks.size :]
        interval = np.diff(blocks) * NANOSECOND
        usual, mean = np.median(interval, axis=1, keepdims=True), np.mean(interval, axis=1, keepdims=True)
        together = np.mean(interval < 2.0 * TOGETHER * np.maximum(usual, mean), axis=1)  # all with bursts, at least
        suspect = np.flatnonzero((_jitter(interval, usual) > LEAST) | (together >= LEAST_TOGETHER))
        for number in [*suspect.tolist(), *range(len(blocks))[-1:]]:
            self.noise = stamp_noise(blocks[number])
            if self.corrected:
                end = DECIDING * (number + 1 if known or number else 0)
                return max(end - (len(stamps) - len(stamp)), 0)
        return len(stamp)

    def _regular(self, new: OrderedSamples, noise: StampNoise, final: bool) -> OrderedSamples:
        before = new.stamp[:1] if self._last is None else np.array([self._last])
        gap = np.diff(np.concatenate([before, new.stamp])) * NANOSECOND
        longest = BURST_PERIODS * noise.period if noise.bursts else longest_interval(noise.period)
        begins = np.flatnonzero((gap > longest) | new.interrupted)
        found, segment = list[OrderedSamples](), self._segment or _Segment(noise)
        for number, rows in enumerate(np.split(np.arange(len(new)), begins)):
            if number:
                found.append(segment.take(taken(new, rows[:0]), final=True))
                segment = _Segment(noise)
            found.append(segment.take(taken(new, rows)))
        if final:
            found.append(segment.take(taken(new, slice(0, 0)), final=True))
        self._segment = None if final else segment
        self._last = int(new.stamp[-1]) if len(new) else self._last
        return joined(found)


class _Segment(Portions):
    """An uninterrupted run of samples; number: of each in the grid, as far as it is known."""

    def __init__(self, noise: StampNoise) -> None:
        super().__init__()
        self._noise, self._width = noise, WIDTH if noise.bursts else width(noise)
        self._number = np.empty(0, np.int64)
        self._newest: int | None = None  # regular stamp (ns) that was returned last

    def take(self, new: OrderedSamples, final: bool = False) -> OrderedSamples:
        """Add samples and return those whose regular stamps are known."""
        samples = self._with(new)
        self._count(samples.stamp, final)
        begin, end = self._returned, max(len(self._number) - (0 if final else AROUND), self._returned)
        stamp = samples.stamp[: len(self._number)]
        parts = [self._line_at(stamp, at, min(at + ROWS, end)) for at in range(begin, end, ROWS)]
        regular = self._increasing(np.concatenate([np.empty(0, np.int64), *parts]))
        count = max(end - KEPT, 0)
        self._keep(samples, slice(count, None), end - count)
        self._number = self._number[count:]
        return replace(taken(samples, slice(begin, end)), stamp=regular)

    def _line_at(self, stamp: IntArray, begin: int, end: int) -> IntArray:
        """Stamps (end - begin,) in ns at these samples, of lines through the AROUND samples on either side of each."""
        at = np.arange(begin, end)[:, None] + np.arange(-AROUND, AROUND + 1)
        inside: BoolArray = (at >= 0) & (at < len(stamp))
        at, middle = np.clip(at, 0, max(len(stamp) - 1, 0)), slice(begin, end)
        number, late = self._number[at] - self._number[middle, None], stamp[at] - stamp[middle, None]
        bursts, period = self._noise.bursts, 1e9 * self._noise.period
        line = low_of(late - period * number, inside) if bursts else _lines_at(number, late, inside)
        return np.asarray(stamp[middle] + np.rint(line).astype(np.int64))

    def _count(self, stamp: IntArray, final: bool) -> None:
        """Number the samples, those of the last three widths only if the run has ended: more may be missing there."""
        known, noise = len(self._number), self._noise
        end = len(stamp) - (0 if final else 3 * self._width)
        if end > known:
            missing = missing_in_bursts(stamp, noise.period) if noise.bursts else missing_before(stamp, noise)
            last = int(self._number[-1]) if known else -1
            self._number = np.concatenate([self._number, last + np.cumsum(missing[known:end] + 1)])

    def _increasing(self, stamp: IntArray) -> IntArray:
        """The stamps, each at least a nanosecond after the one before."""
        before = stamp[:1] - 1 if self._newest is None else np.array([self._newest])
        step = np.arange(len(stamp) + 1)
        found = (np.maximum.accumulate(np.concatenate([before, stamp]) - step) + step)[1:]
        self._newest = int(found[-1]) if len(found) else self._newest
        return found


def _lines_at(number: IntArray, late: IntArray, inside: BoolArray) -> Array:
    """The values (m,) at number 0 of lines through those (m, k) that are inside a run."""
    x, y = (np.where(inside, of, 0).astype(np.float64) for of in (number, late))
    count = inside.sum(axis=1)
    mean_x, mean_y = x.sum(axis=1) / count, y.sum(axis=1) / count
    spread = (np.where(inside, x - mean_x[:, None], 0.0) ** 2).sum(axis=1)
    slope = (np.where(inside, x - mean_x[:, None], 0.0) * y).sum(axis=1) / np.where(spread > 0.0, spread, 1.0)
    return np.asarray(mean_y - slope * mean_x)


def stamp_noise(stamp: IntArray) -> StampNoise | None:
    """The noise of stamps (n,) in ns, in order of arrival; None for too few. Robust to gaps and missing samples."""
    interval = np.diff(stamp) * NANOSECOND
    if len(stamp) < FEWEST or not np.any(interval > 0.0):
        return None
    usual = float(np.median(interval[interval > 0.0]))
    jitter = float(_jitter(interval, usual))
    if (period := burst_period(stamp[:DECIDING])) is not None:
        return StampNoise(period, jitter, corrected=True, bursts=True)
    large = max(SHARE * usual, LEAST) < jitter <= LARGEST_SHARE * usual
    return StampNoise(usual, jitter, bool(large and _is_regular(interval - usual, LIMIT * jitter)))


def _jitter(interval: Array, usual: Array | float) -> Array:
    """Standard deviations (...) of stamps with intervals (..., n); the median ignores gaps."""
    # An interval has the noise of two stamps.
    return np.asarray(SD * np.median(np.abs(interval - usual), axis=-1) / np.sqrt(2.0))


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
    w = width(noise)
    if len(stamp) < 4 * w + 1:
        return np.zeros(len(stamp), np.int64)
    sums = np.concatenate([[0], np.cumsum(stamp - stamp[0])])  # of integers, so that their rounding depends on nothing
    means = sums[w:] - sums[:-w]  # of `width` stamps from each on, times the width
    step = means[w:] - means[:-w]  # at a place w later
    excess = 2 * step[w:-w] - step[: -2 * w] - step[2 * w :]  # at a place 2 w later, times twice the width
    return _at_peaks(excess * NANOSECOND / (2 * w * noise.period), w, 2 * w)


def _at_peaks(missing: Array, reach: int, before: int) -> IntArray:
    """The whole numbers of missing samples where they are the largest within a reach, else 0.

    missing (m,): as steps of the stamps show it, from the sample with the index `before` on; as many after them are not
    judged, but one.
    """
    largest = sliding_window_view(np.pad(missing, reach, constant_values=-np.inf), 2 * reach + 1).max(axis=1)
    count = np.rint(missing).astype(np.int64)
    peak = (missing == largest) & (count > 0)
    peak[1:] &= ~peak[:-1]
    return np.pad(np.where(peak, count, 0), (before, before - 1))


# --- bursts -----------------------------------------------------------------------------------------------------------


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
    if n < 2 * WIDTH + 1:
        return np.zeros(n, np.int64)
    late = (stamp - stamp[0]) * NANOSECOND - period * np.arange(n)
    low = np.percentile(sliding_window_view(late, WIDTH), LOW, axis=1)
    return _at_peaks((low[WIDTH:] - low[:-WIDTH]) / period, WIDTH, WIDTH)


def low_of(late: Array, inside: BoolArray) -> Array:
    """The deviation (m,) of those that arrived soon, among the deviations (m, k) that are inside a run."""
    late = np.sort(np.where(inside, late, np.inf), axis=1)
    low = (0.01 * LOW * (inside.sum(axis=1) - 1)).astype(np.int64)
    return np.asarray(late[np.arange(len(late)), low])
