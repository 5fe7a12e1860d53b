# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Statistics of a server's requests: how many were answered and refused, and how long the callbacks took."""

from __future__ import annotations

import threading
from collections import deque

import numpy as np

KEPT = 2000  # callbacks that the percentiles cover


class RequestStatistics:
    """Counts and callback times; safe to use from any thread, with bounded memory."""

    def __init__(self) -> None:
        self._served = self._refused = 0
        self._last_refusal: str | None = None
        self._seconds: deque[float] = deque(maxlen=KEPT)
        self._lock = threading.Lock()

    def add(self, seconds: float, refusal: str | None) -> None:
        """Count one request. seconds: time in the callback; refusal: the reason, None if it was answered."""
        with self._lock:
            self._seconds.append(seconds)
            if refusal is None:
                self._served += 1
            else:
                self._refused += 1
                self._last_refusal = refusal

    def values(self) -> dict[str, object]:
        """Named values for a diagnostic status; times in microseconds over the last KEPT requests."""
        with self._lock:
            seconds = list(self._seconds)
            served, refused, last = self._served, self._refused, self._last_refusal
        p50, p99 = np.percentile(seconds, [50, 99]) * 1e6 if seconds else (None, None)
        return {
            "requests_served": served,
            "requests_refused": refused,
            "last_refusal": last,
            "callback_p50_us": p50,
            "callback_p99_us": p99,
        }
