# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Serialized messages of scalar topics, collected into streams; messages without a header are dated by /clock."""

from __future__ import annotations

import struct
import threading
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from push_predictor.online.message_buffer import LIMIT
from push_predictor.recordings.fields.sources import FieldReader
from push_predictor.recordings.samples import check_samples, scalar_rules
from push_predictor.recordings.streams import ScalarStream
from push_predictor.types import BoolArray

CLOCKS = 4000  # messages of /clock that are kept
FAR = 3_600_000_000_000  # ns; a stamp farther than this from the poses' stamps is of another clock
NEVER = np.iinfo(np.int64).min


class ClockHistory:
    """The times published on /clock, by the time (ns) at which they were sent."""

    def __init__(self) -> None:
        self._sent: list[int] = []
        self._clock: list[int] = []

    def put(self, data: bytes, sent: int) -> None:
        """Add a message of /clock."""
        seconds, rest = struct.unpack_from("<iI" if data[1] & 1 else ">iI", data, 4)
        self._sent.append(max(sent, self.newest or 0))
        self._clock.append(seconds * 1_000_000_000 + rest)
        if len(self._sent) > CLOCKS:
            del self._sent[: CLOCKS // 2], self._clock[: CLOCKS // 2]

    @property
    def newest(self) -> int | None:
        """When the last message was sent, None without any."""
        return self._sent[-1] if self._sent else None

    def at(self, sent: int) -> int | None:
        """The time (ns) published last before something was sent; None if it is not known."""
        place = bisect_right(self._sent, sent)
        return self._clock[place - 1] if place else None


class ScalarBuffer:
    """Serialized messages of one scalar topic until they are taken; unusable ones are counted by kind.

    kind: one of the types that a recording's scalars have; another type needs the reader of a field. Beyond LIMIT the
    oldest messages are dropped and counted.
    """

    def __init__(self, kind: str, reader: FieldReader | None = None) -> None:
        self.kind = kind
        self.received = 0
        self.rejected: Counter[str] = Counter()
        self._reader = reader
        self._rules = scalar_rules(kind if reader is None else reader.target.type)
        self._waiting: list[tuple[bytes, int]] = []
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def timed(self) -> bool:
        """Whether messages contain their time."""
        return self._rules.layout.header if self._reader is None else self._reader.timed

    def put(self, data: bytes, sent: int) -> None:
        """Add a message and the time (ns) at which it was sent, from any thread."""
        with self._lock:
            self.received += 1
            self._waiting.append((data, sent))
            if len(self._waiting) > LIMIT:
                self.rejected["dropped"] += LIMIT // 10
                del self._waiting[: LIMIT // 10]

    def take(self, until: int, time_of: Callable[[int], int | None], near: int | None) -> ScalarStream:
        """The usable samples since the last call; of messages without a time those that were sent before `until` (ns).

        time_of: returns their time from when they were sent, None if it is not known. near: a recent stamp (ns) of the
        poses, None if there is none.
        """
        with self._lock:
            count = len(self._waiting) if self.timed else sum(sent < until for _, sent in self._waiting)
            taken, self._waiting = self._waiting[:count], self._waiting[count:]
        messages: Sequence[bytes] = [data for data, _ in taken]
        if self._reader is not None:
            messages = self._reader.read(messages, [sent for _, sent in taken])
        checked = check_samples(messages, self._rules)
        self.rejected.update(checked.rejected)
        dated = [NEVER if (time := time_of(sent)) is None else time for _, sent in taken] if not self.timed else ()
        stamp = checked.stamp if self.timed else np.array(dated, dtype=np.int64)
        usable = self._kept("without time", checked.usable, stamp != NEVER)
        if near is not None:
            usable = self._kept("another clock", usable, (stamp > near - FAR) & (stamp < near + FAR))
        return ScalarStream(stamp[usable], checked.values[usable, 0])

    def _kept(self, kind: str, usable: BoolArray, good: BoolArray) -> BoolArray:
        if count := int(np.sum(usable & ~good)):
            self.rejected[kind] += count
        return usable & good
