# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Messages of one topic, many at a time, without a Python object for each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from push_predictor.types import IntArray

PORTION = 20_000  # single messages that are gathered


class RawMessage(NamedTuple):
    """A message as recorded: topic, type (package/msg/Name), log time in ns, CDR bytes."""

    topic: str
    type: str
    log_time: int
    data: bytes


@dataclass(frozen=True, eq=False)
class Messages:
    """n CDR messages of one topic and type, in their order.

    times (n,): when they were logged or sent, ns. They lie in `buffer`, from byte start (n,) on, length (n,) bytes.
    """

    topic: str
    type: str
    times: IntArray
    buffer: bytes | bytearray | memoryview
    start: IntArray
    length: IntArray

    @staticmethod
    def of(topic: str, kind: str, times: Sequence[int] | IntArray, data: Sequence[bytes]) -> Messages:
        """The same of single messages."""
        length = np.fromiter(map(len, data), np.int64, len(data))
        # Damaged files have times of more than 63 bits.
        logged = times if isinstance(times, np.ndarray) else np.array(times, np.uint64).astype(np.int64)
        return Messages(topic, kind, logged, b"".join(data), np.cumsum(length) - length, length)

    def __len__(self) -> int:
        return len(self.times)

    def __getitem__(self, row: int) -> bytes:
        begin = int(self.start[row])
        return bytes(self.buffer[begin : begin + int(self.length[row])])

    def of_equal_length(self) -> Iterator[tuple[IntArray, NDArray[np.uint8]]]:
        """Rows (m,) of messages of the same length, and their bytes (m, length)."""
        data = np.frombuffer(self.buffer, np.uint8)
        for length in np.unique(self.length).tolist():
            rows = np.flatnonzero(self.length == length)
            yield rows, data[self.start[rows][:, None] + np.arange(length)]


def gathered(messages: Iterable[RawMessage]) -> Iterator[Messages]:
    """Single messages as portions of each topic and type."""
    waiting = iter(messages)
    while portion := list(islice(waiting, PORTION)):
        topics, kinds, times, data = zip(*portion, strict=True)
        sources = list(zip(topics, kinds, strict=True))
        numbers = {source: number for number, source in enumerate(dict.fromkeys(sources))}
        of = np.fromiter(map(numbers.__getitem__, sources), np.int64, len(portion))
        whole = Messages.of("", "", times, data)
        for (topic, kind), number in numbers.items():
            rows = np.flatnonzero(of == number)
            yield Messages(topic, kind, whole.times[rows], whole.buffer, whole.start[rows], whole.length[rows])
