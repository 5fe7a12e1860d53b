# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Scalar topics while samples arrive: their values at the start of a window."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.dropouts import CLOCK_SET
from push_predictor.recordings.streams import ScalarStream
from push_predictor.types import Array, IntArray

LONGEST_GAP = 5_000_000_000  # ns; in a longer gap between samples a scalar keeps the earlier value


class ScalarTrack:
    """The samples of one topic, with increasing stamps.

    discarded: number of samples whose stamp did not increase.
    """

    def __init__(self) -> None:
        self._stamp: IntArray = np.empty(0, dtype=np.int64)
        self._value: Array = np.empty(0)
        self.discarded = 0

    def add(self, stream: ScalarStream) -> None:
        """Append samples; where the clock was set back, all earlier samples are removed."""
        if not len(stream):
            return
        stamp, value = np.append(self._stamp, stream.stamp), np.append(self._value, stream.value)
        back = np.flatnonzero(np.diff(stamp) < -CLOCK_SET)
        if back.size:
            stamp, value = stamp[back[-1] + 1 :], value[back[-1] + 1 :]
        newer = np.diff(np.maximum.accumulate(stamp), prepend=np.iinfo(np.int64).min // 2) > 0
        self.discarded += int(np.sum(~newer))
        self._stamp, self._value = stamp[newer], value[newer]

    def known_at(self, stamp: int) -> bool:
        """Whether there is a sample at or after a time (ns), so that the value at this time is final."""
        return bool(len(self._stamp)) and int(self._stamp[-1]) >= stamp

    def at(self, stamp: int) -> float | None:
        """The value at a time (ns), None without samples.

        It is linear between samples, and constant in gaps longer than LONGEST_GAP and beyond the ends.
        """
        if not len(self._stamp):
            return None
        after = int(np.searchsorted(self._stamp, stamp, side="right"))
        if after == 0 or after == len(self._stamp):
            return float(self._value[max(after - 1, 0)])
        begin, end = int(self._stamp[after - 1]), int(self._stamp[after])
        first, second = float(self._value[after - 1]), float(self._value[after])
        return first + (second - first) * ((stamp - begin) / (end - begin)) if end - begin <= LONGEST_GAP else first

    def forget_before(self, stamp: int) -> None:
        """Remove the samples before a time (ns), except the last of them."""
        keep = max(0, int(np.searchsorted(self._stamp, stamp, side="right")) - 1)
        self._stamp, self._value = self._stamp[keep:], self._value[keep:]
