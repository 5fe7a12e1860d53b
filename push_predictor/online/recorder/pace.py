# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How regularly the samples of a stream arrive."""

from __future__ import annotations

import numpy as np

from push_predictor.types import IntArray

SILENCE = 3.0  # s without a sample after which a stream is called silent
SILENT_PERIODS = 4.0  # mean periods; a stream slower than once in a second may be silent for longer
NANOSECOND = 1e-9


class Pace:
    """Number, rate and largest gap of a stream's samples. since: time (s) from which on samples are expected.

    largest_gap: s, between two consecutive stamps.
    """

    def __init__(self, since: float) -> None:
        self.samples = 0
        self.largest_gap = 0.0
        self._first = self._last = 0  # ns
        self._heard = since

    def add(self, stamp: IntArray, now: float) -> None:
        """Add samples with stamps (n,) in ns that arrived by now (s); now is of the clock of `since`."""
        if not len(stamp):
            return
        if not self.samples:
            self._first = self._last = int(stamp[0])
        gaps = np.diff(stamp, prepend=self._last) * NANOSECOND
        self.largest_gap = max(self.largest_gap, float(gaps.max()))
        self.samples += len(stamp)
        self._last, self._heard = int(stamp[-1]), now

    @property
    def rate(self) -> float:
        """Samples per second, 0 for fewer than two."""
        span = (self._last - self._first) * NANOSECOND
        return (self.samples - 1) / span if span > 0.0 else 0.0

    def silent(self, now: float) -> float:
        """For how long (s) there has been no sample; 0 while that is not unusual."""
        period = 1.0 / self.rate if self.rate else 0.0
        quiet = now - self._heard
        return quiet if quiet >= max(SILENCE, SILENT_PERIODS * period) else 0.0
