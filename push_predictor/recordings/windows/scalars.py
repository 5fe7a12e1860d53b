"""Scalar topics while they arrive: what each was worth when a window began."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.streams import ScalarStream
from push_predictor.types import Array, IntArray

APART = 5_000_000_000  # ns; between samples farther apart than this a scalar keeps the value of the earlier one
SET_BACK = 1_000_000_000  # ns; a stamp earlier than this before the last one begins the topic anew


class ScalarTrack:
    """Samples of one topic. A sample whose stamp does not increase is refused and counted."""

    def __init__(self) -> None:
        self._stamp: IntArray = np.empty(0, dtype=np.int64)
        self._value: Array = np.empty(0)
        self.refused = 0

    def add(self, stream: ScalarStream) -> None:
        """Append the samples; a clock that was set back makes those before it void."""
        if not len(stream):
            return
        stamp, value = np.append(self._stamp, stream.stamp), np.append(self._value, stream.value)
        back = np.flatnonzero(np.diff(stamp) < -SET_BACK)
        if back.size:
            stamp, value = stamp[back[-1] + 1 :], value[back[-1] + 1 :]
        newer = np.diff(np.maximum.accumulate(stamp), prepend=np.iinfo(np.int64).min // 2) > 0
        self.refused += int(np.sum(~newer))
        self._stamp, self._value = stamp[newer], value[newer]

    def passed(self, stamp: int) -> bool:
        """Whether the value at a time (ns) is settled: there is a sample at or after it."""
        return bool(len(self._stamp)) and int(self._stamp[-1]) >= stamp

    def at(self, stamp: int) -> float | None:
        """The value at a time (ns): linear between samples, constant in gaps and beyond the ends; None without any."""
        if not len(self._stamp):
            return None
        after = int(np.searchsorted(self._stamp, stamp, side="right"))
        if after == 0 or after == len(self._stamp):
            return float(self._value[max(after - 1, 0)])
        begin, end = int(self._stamp[after - 1]), int(self._stamp[after])
        first, second = float(self._value[after - 1]), float(self._value[after])
        return first + (second - first) * ((stamp - begin) / (end - begin)) if end - begin <= APART else first

    def forget_before(self, stamp: int) -> None:
        """Drop the samples before a time (ns), but the last of them."""
        keep = max(0, int(np.searchsorted(self._stamp, stamp, side="right")) - 1)
        self._stamp, self._value = self._stamp[keep:], self._value[keep:]
