"""What a server has done: requests served and refused, and how long its callbacks took. No ROS here."""

from __future__ import annotations

import threading
from collections import deque

import numpy as np

KEPT = 2000  # callbacks that the percentiles look back over


class RequestLog:
    """Counts of a server's requests, from any thread; memory does not grow with them."""

    def __init__(self) -> None:
        self._served = self._refused = 0
        self._last_refusal: str | None = None
        self._seconds: deque[float] = deque(maxlen=KEPT)
        self._lock = threading.Lock()

    def add(self, seconds: float, refusal: str | None) -> None:
        """Count one request that took so long; refusal: the reason, None if it was served."""
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
