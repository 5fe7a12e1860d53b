"""Buffers of serialized sensor messages, checked by the rules of recordings/samples.py when they are taken."""

from __future__ import annotations

import threading
from collections import Counter

from push_predictor.recordings.samples import SampleRules, check_samples
from push_predictor.types import Array, IntArray

LIMIT = 200_000  # messages waiting per topic: over 13 minutes at 250 Hz, 25 MB


class MessageBuffer:
    """Serialized messages of one topic until they are taken; rejected counts unusable ones by fault.

    frame_id: the frame that headers must name, empty for any. Beyond LIMIT the oldest messages are dropped and counted.
    """

    def __init__(self, rules: SampleRules, frame_id: str) -> None:
        self.received = 0
        self.dropped = 0
        self.rejected: Counter[str] = Counter()
        self._rules = rules
        self._frame_id = frame_id
        self._waiting: list[bytes] = []
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, data: bytes) -> None:
        """Add a message, from any thread."""
        with self._lock:
            self.received += 1
            self._waiting.append(data)
            if len(self._waiting) > LIMIT:
                excess = LIMIT // 10  # at once, so that a full buffer is not shifted for every message
                del self._waiting[:excess]
                self.dropped += excess

    def take(self) -> tuple[IntArray, Array]:
        """Stamps (n,) in ns and numbers (n, k) of the usable messages since the last call."""
        with self._lock:
            waiting, self._waiting = self._waiting, []
        checked = check_samples(waiting, self._rules, self._frame_id)
        self.rejected.update(checked.rejected)
        return checked.stamp[checked.usable], checked.values[checked.usable]
