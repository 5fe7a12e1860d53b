"""One stream while it arrives: samples in stamp order, their dropouts and jumps, values in between."""

from __future__ import annotations

from collections import Counter

import numpy as np

from push_predictor.geometry.frames import wrap_angle
from push_predictor.recordings.windows.stamp_order import Ordered, StampOrder
from push_predictor.types import Array, BoolArray, IntArray

PERIOD_SAMPLES = 50  # intervals that settle a stream's period: the first ones, so that no later arrival changes it
SHORTEST_DROPOUT = 0.020  # s
DROPOUT_PERIODS = 4.0
NANOSECOND = 1e-9
JUMP = 0.005  # m between two samples, beside JUMP_SPEED: put elsewhere, or seen elsewhere, but not moved there
JUMP_SPEED = 1.5  # m/s
TURN = 0.1  # rad between two samples, beside TURN_SPEED
TURN_SPEED = 8.0  # rad/s


class Track:
    """Samples of one stream: header stamps (n,) in ns, times (n,) in s after an origin (ns), values (n, width).

    place: the first two columns are a position, m, in which jumps are told. angle: the column that holds an angle,
    kept unwrapped. counts: samples left out by kind, see StampOrder; jumps also counts those after which the stream
    goes on elsewhere.
    """

    def __init__(self, width: int, place: bool = False, angle: int | None = None) -> None:
        self.stamp: IntArray = np.empty(0, dtype=np.int64)
        self.time: Array = np.empty(0)
        self.values: Array = np.empty((0, width))
        self.broken: BoolArray = np.empty(0, dtype=np.bool_)  # (n,): between the one before and this nothing is known
        self.order = StampOrder(width, self.torn if place else None)
        self.jumps = 0
        self._angle = angle
        self._period: float | None = None

    def __len__(self) -> int:
        return len(self.stamp)

    @property
    def counts(self) -> Counter[str]:
        """Samples left out and jumps, by kind."""
        return self.order.counts + Counter(jumps=self.jumps)

    @property
    def empty(self) -> bool:
        """Has no sample come, not even one that is still to be judged?"""
        return not len(self) and not len(self.order.waiting[0])

    def extend(self, new: Ordered, origin: int) -> None:
        """Append samples that `order` gave."""
        values, first = self._unwrapped(new.values), min(len(self), 1)
        times = (np.concatenate([self.stamp[-1:], new.stamp]) - origin) * NANOSECOND
        jumps = np.zeros(len(values), dtype=np.bool_)
        if self.order.torn is not None:
            joined = np.concatenate([self.values[-1:], values])
            jumps[1 - first :] = self.order.torn(joined[:-1], joined[1:], np.diff(times))
        self.jumps += int(np.sum(jumps))
        self.stamp = np.concatenate([self.stamp, new.stamp])
        self.time = np.concatenate([self.time, times[first:]])
        self.values = np.concatenate([self.values, values])
        self.broken = np.concatenate([self.broken, new.broken | jumps])

    def forget_before(self, time: float) -> None:
        """Drop the samples before `time`, but the last of them."""
        keep = max(0, int(np.searchsorted(self.time, time)) - 1)
        if self._period is not None:
            self.stamp, self.time = self.stamp[keep:], self.time[keep:]
            self.values, self.broken = self.values[keep:], self.broken[keep:]

    def at(self, time: Array) -> Array:
        """Values (m, width) at times (m,), linear between samples and constant beyond them."""
        return np.column_stack([np.interp(time, self.time, column) for column in self.values.T])

    def settled(self, final: bool) -> bool:
        """Whether the period is known, so that dropouts can be told; if no more will come, what came must do."""
        if self._period is None and (final or len(self) > PERIOD_SAMPLES):
            self._period = float(np.median(np.diff(self.time[: PERIOD_SAMPLES + 1]))) if len(self) > 1 else 0.0
        return self._period is not None

    @property
    def period(self) -> float:
        """Median interval of the first samples, s; 0 while it is not settled."""
        return self._period or 0.0

    def silent_in(self, start: Array, end: Array) -> tuple[BoolArray, BoolArray]:
        """For intervals (start, end] (m,): whether a break overlaps each, and whether one reaches beyond its end.

        A break is a dropout or a jump.
        """
        begins, ends = self._breaks()  # in order and disjoint: the last that begins before `end` decides
        last = np.searchsorted(begins, end, side="left") - 1
        return ends[last] > start, ends[last] > end

    def dropouts(self, start: float, end: float) -> int:
        """How many dropouts between samples end within (start, end] (s)."""
        ends = self.time[1:][np.diff(self.time) > self.longest_gap]
        return int(np.sum((ends > start) & (ends <= end)))

    @property
    def longest_gap(self) -> float:
        """What is longer (s) between two samples is a dropout."""
        return max(SHORTEST_DROPOUT, DROPOUT_PERIODS * self.period)

    def _breaks(self) -> tuple[Array, Array]:
        """Starts (k,) and ends (k,); the stream is silent before its first sample and, some time on, after its last."""
        late = np.flatnonzero((np.diff(self.time) > self.longest_gap) | self.broken[1:])
        begins = np.concatenate([[-np.inf], self.time[late], [self.time[-1] + self.longest_gap]])
        return begins, np.concatenate([[self.time[0]], self.time[late + 1], [np.inf]])

    def torn(self, before: Array, after: Array, lapse: Array) -> BoolArray:
        """Whether nothing moves from one pose (n, width) to another (n, width) within a time (n,) s."""
        step = after - before
        torn = np.hypot(step[:, 0], step[:, 1]) > JUMP + JUMP_SPEED * lapse
        if self._angle is not None:
            torn = torn | (np.abs(wrap_angle(step[:, self._angle])) > TURN + TURN_SPEED * lapse)
        return np.asarray(torn)

    def _unwrapped(self, values: Array) -> Array:
        if self._angle is None or not len(values):
            return values
        values = values.copy()
        before = self.values[-1:, self._angle]
        values[:, self._angle] = np.unwrap(np.concatenate([before, values[:, self._angle]]))[len(before) :]
        return values
