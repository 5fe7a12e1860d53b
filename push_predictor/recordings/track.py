"""One stream while it arrives: samples in stamp order, their dropouts, values in between."""

from __future__ import annotations

import numpy as np

from push_predictor.types import Array, BoolArray, IntArray

PERIOD_SAMPLES = 50  # intervals that settle a stream's period: the first ones, so that no later arrival changes it
SHORTEST_DROPOUT = 0.020  # s
DROPOUT_PERIODS = 4.0
NANOSECOND = 1e-9


class Track:
    """Samples of one stream: header stamps (n,) in ns, times (n,) in s after `origin` (ns), values (n, width).

    angle: the column that holds an angle, kept unwrapped. A sample whose stamp does not increase is refused and
    counted.
    """

    def __init__(self, width: int, angle: int | None = None) -> None:
        self.stamp: IntArray = np.empty(0, dtype=np.int64)
        self.time: Array = np.empty(0)
        self.values: Array = np.empty((0, width))
        self.refused = 0
        self._angle = angle
        self._period: float | None = None

    def __len__(self) -> int:
        return len(self.stamp)

    def extend(self, stamp: IntArray, values: Array, origin: int) -> None:
        """Append the samples (n,), (n, width) whose stamps increase."""
        last = self.stamp[-1] if len(self) else np.iinfo(np.int64).min
        newer = stamp > np.maximum.accumulate(np.append(last, stamp))[:-1]
        self.refused += int(np.sum(~newer))
        self.stamp = np.concatenate([self.stamp, stamp[newer]])
        self.time = np.concatenate([self.time, (stamp[newer] - origin) * NANOSECOND])
        self.values = np.concatenate([self.values, self._unwrapped(values[newer])])

    def forget_before(self, time: float) -> None:
        """Drop the samples before `time`, but the last of them."""
        keep = max(0, int(np.searchsorted(self.time, time)) - 1)
        if self._period is not None:
            self.stamp, self.time, self.values = self.stamp[keep:], self.time[keep:], self.values[keep:]

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
        """For intervals (start, end] (m,): whether a dropout overlaps each, and whether one reaches beyond its end."""
        begins, ends = self._dropouts()  # in order and disjoint: the last that begins before `end` decides
        last = np.searchsorted(begins, end, side="left") - 1
        return ends[last] > start, ends[last] > end

    def _dropouts(self) -> tuple[Array, Array]:
        """Starts (k,) and ends (k,); the stream is silent before its first sample and, some time on, after its last."""
        limit = max(SHORTEST_DROPOUT, DROPOUT_PERIODS * self.period)
        late = np.flatnonzero(np.diff(self.time) > limit)
        begins = np.concatenate([[-np.inf], self.time[late], [self.time[-1] + limit]])
        return begins, np.concatenate([[self.time[0]], self.time[late + 1], [np.inf]])

    def _unwrapped(self, values: Array) -> Array:
        if self._angle is None or not len(values):
            return values
        values = values.copy()
        before = self.values[-1:, self._angle]
        values[:, self._angle] = np.unwrap(np.concatenate([before, values[:, self._angle]]))[len(before) :]
        return values
