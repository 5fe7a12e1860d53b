# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Buffers of serialized sensor messages, checked by the rules of recordings/samples.py when they are taken."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from push_predictor.recordings.bag.cdr import decode
from push_predictor.recordings.samples import SampleRules, check_samples
from push_predictor.types import Array, IntArray

Convert: TypeAlias = Callable[[Sequence[bytes], Sequence[int]], Sequence[bytes]]  # messages, and when they were sent
RECENT = 250  # messages that are kept for the report about a topic
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
        self._convert: Convert = unchanged
        self._waiting: list[bytes] = []
        self._sent: list[int] = []
        self._recent: deque[tuple[bytes, int, int]] = deque(maxlen=RECENT)
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, data: bytes, sent: int = 0, received: int = 0) -> None:
        """Add a message, from any thread; sent and received: when that was, ns."""
        with self._lock:
            self.received += 1
            self._waiting.append(data)
            self._sent.append(sent)
            self._recent.append((data, sent, received))
            if len(self._waiting) > LIMIT:
                excess = LIMIT // 10  # at once, so that a full buffer is not shifted for every message
                del self._waiting[:excess], self._sent[:excess]
                self.dropped += excess

    def convert_by(self, convert: Convert, frame_id: str) -> None:
        """Convert messages that come from now on to the type of the rules, which must name this frame."""
        with self._lock:
            # Messages of the earlier type that still wait cannot be read by the new conversion.
            self.dropped += len(self._waiting)
            self._waiting, self._sent = [], []
            self._recent.clear()
            self._convert, self._frame_id = convert, frame_id

    def take(self) -> tuple[IntArray, Array]:
        """Stamps (n,) in ns and numbers (n, k) of the usable messages since the last call."""
        with self._lock:
            waiting, self._waiting = self._waiting, []
            sent, self._sent = self._sent, []
            messages, frame_id = self._convert(waiting, sent), self._frame_id
        checked = check_samples(messages, self._rules, frame_id)
        self.rejected.update(checked.rejected)
        return checked.stamp[checked.usable], checked.values[checked.usable]

    def recent(self) -> tuple[IntArray, IntArray, frozenset[str]]:
        """Stamps (n,) and times of receipt (n,) in ns of the last readable messages, and the frames that they name."""
        with self._lock:
            recent = list(self._recent)
            messages = self._convert([data for data, _, _ in recent], [sent for _, sent, _ in recent])
        columns = decode(messages, self._rules.layout)
        received = np.array([time for _, _, time in recent], dtype=np.int64)
        return columns.stamp[columns.valid], received[columns.valid], columns.frames


def unchanged(messages: Sequence[bytes], sent: Sequence[int]) -> Sequence[bytes]:
    """The messages, which have the type of the rules already."""
    return messages
