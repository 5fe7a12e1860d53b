# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How late messages are: a histogram of bounded size, cheap enough for every message."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass

_PER_DOUBLING = 16  # bins are a factor of 1.044 wide: a percentile is accurate to 4.4 %
_BINS = 40 * _PER_DOUBLING  # up to 2**40 ns, 18 minutes


@dataclass(frozen=True)
class Delays:
    """Percentiles and maximum of the lateness of many messages, us."""

    p50: float
    p99: float
    maximum: float

    def to_text(self) -> str:
        """The figures without decimals."""
        return f"p50 {self.p50:.0f} us, p99 {self.p99:.0f} us, max {self.maximum:.0f} us"


class Lateness:
    """A histogram of durations in ns; negative ones count as 0."""

    def __init__(self) -> None:
        self._bins = [0] * _BINS
        self._lock = threading.Lock()
        self.count = 0
        self.maximum = 0

    def add(self, late: int) -> None:
        """Add one duration."""
        place = min(_BINS - 1, int(_PER_DOUBLING * math.log2(late))) if late > 1 else 0
        with self._lock:
            self._bins[place] += 1
            self.count += 1
            self.maximum = max(self.maximum, late)

    def delays(self) -> Delays:
        """The figures of all durations so far."""
        return Delays(self.percentile(0.5) / 1000.0, self.percentile(0.99) / 1000.0, self.maximum / 1000.0)

    def percentile(self, share: float) -> float:
        """The duration in ns that a share (0 to 1) of all does not exceed, rounded up to its bin."""
        with self._lock:
            bins, rank, maximum = list(self._bins), math.ceil(share * self.count), self.maximum
        seen = 0
        for place, number in enumerate(bins):
            seen += number
            if number and seen >= rank:
                return min(float(maximum), math.pow(2.0, (place + 1) / _PER_DOUBLING))
        return 0.0
