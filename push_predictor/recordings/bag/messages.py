# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What every file of a bag gives: raw messages, single or many of one topic at a time, and notes on what is lost.

Messages are CDR (XCDR1). `encode` makes them from numbers.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from push_predictor.types import Array, IntArray

PORTION = 20_000  # single messages that are gathered
_PREFIX = 4  # bytes of encapsulation: 0, 1 little-endian, then two of options
_STAMP, _FRAME = 4, 16
_NUMBER = 8  # bytes, to which numbers are aligned, counted from the fourth byte of a message
_NANO = 1_000_000_000


class RawMessage(NamedTuple):
    """A message as recorded: topic, type (package/msg/Name), log time in ns, CDR bytes."""

    topic: str
    type: str
    log_time: int
    data: bytes


class Notes(list[str]):
    """Sentences, each once. losses: those of them about data that are missing or cannot be read."""

    def __init__(self) -> None:
        super().__init__()
        self.losses: list[str] = []

    def add(self, text: str, *, lost: bool = False) -> None:
        """Add a sentence, if it is new. lost: data are missing for it."""
        if text in self:
            return
        self.append(text)
        if lost:
            self.losses.append(text)

    def add_all(self, other: Notes) -> None:
        """Add the sentences of others."""
        for text in other:
            self.add(text, lost=text in other.losses)


class BagFile:
    """One file, or a folder of streams.

    topics: {topic: type, '' if its schema is missing}; schemas: {type: definition text}; qos: {topic: offered QoS as
    YAML text, '' if unknown}; metadata: {record name: {key: value}}; notes: damage found so far. name: of the file in
    notes, by default its path. storage: rosbag2's name of the format, '' if it cannot read it.
    """

    storage = ""

    def __init__(self, path: Path, name: str = "") -> None:
        self.path, self.name = path, name or str(path)
        self.topics: dict[str, str] = {}
        self.schemas: dict[str, str] = {}
        self.qos: dict[str, str] = {}
        self.metadata: dict[str, Mapping[str, str]] = {}
        self.notes = Notes()

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """CDR messages in file order, of all topics or of the given ones; damage becomes a note."""
        raise NotImplementedError  # each kind of file has its own

    def portions(self, topics: Collection[str]) -> Iterator[Messages]:
        """The same of the given topics, many of a topic and type at once."""
        return gathered(self.messages(topics))

    def _lost(self, what: str) -> None:
        self.notes.add(f"{self.name}: {what}", lost=True)


@dataclass(frozen=True, eq=False)
class Messages:
    """n CDR messages of one topic and type, in their order.

    times (n,): when they were logged or sent, ns. They follow each other in `buffer`, with length (n,) bytes each.
    """

    topic: str
    type: str
    times: IntArray
    buffer: bytes
    length: IntArray

    @staticmethod
    def of(topic: str, kind: str, times: Sequence[int] | IntArray, data: Sequence[bytes]) -> Messages:
        """The same of single messages."""
        length = np.fromiter(map(len, data), np.int64, len(data))
        return Messages(topic, kind, np.asarray(times, np.int64), b"".join(data), length)

    def __len__(self) -> int:
        return len(self.times)

    def of_equal_length(self) -> Iterator[tuple[IntArray, NDArray[np.uint8]]]:
        """Rows (m,) of messages of the same length, and their bytes (m, length)."""
        data, start = np.frombuffer(self.buffer, np.uint8), np.cumsum(self.length) - self.length
        for length in np.unique(self.length).tolist():
            rows = np.flatnonzero(self.length == length)
            if len(rows) == len(self) and length:
                yield rows, data.reshape(-1, length)
            else:
                yield rows, data[start[rows][:, None] + np.arange(length)]


def gathered(messages: Iterable[RawMessage]) -> Iterator[Messages]:
    """Single messages as portions of each topic and type."""
    waiting = iter(messages)
    while True:
        parts: dict[tuple[str, str], tuple[list[int], list[bytes]]] = {}
        for topic, kind, time, content in islice(waiting, PORTION):
            times, contents = parts.get((topic, kind)) or parts.setdefault((topic, kind), ([], []))
            times.append(time)
            contents.append(content)
        if not parts:
            return
        for (topic, kind), (times, contents) in parts.items():
            # Damaged files have times of more than 63 bits.
            yield Messages.of(topic, kind, np.array(times, np.uint64).astype(np.int64), contents)


def encode(stamp: IntArray, values: Array, *, header: bool = True, frame_id: str = "world") -> list[bytes]:
    """One little-endian message per row of values (n, k): a std_msgs/Header or none, then the numbers as float64.

    stamp (n,) in ns is unused without a header. Raises ValueError for a stamp outside the range of
    builtin_interfaces/Time.
    """
    text = frame_id.encode() + b"\0"
    before = _FRAME + len(text) - _PREFIX if header else 0
    start = _PREFIX + -(-before // _NUMBER) * _NUMBER
    numbers = np.ascontiguousarray(values, "<f8").view(np.uint8)
    block = np.zeros((len(values), start + numbers.shape[1]), np.uint8)
    block[:, 1], block[:, start:] = 1, numbers
    if header:
        block[:, _STAMP:_FRAME] = np.frombuffer(_header_words(stamp, len(text)), np.uint8).reshape(-1, 12)
        block[:, _FRAME : _FRAME + len(text)] = np.frombuffer(text, np.uint8)
    data, size = block.tobytes(), block.shape[1]
    return [data[i : i + size] for i in range(0, len(data), size)]


def _header_words(stamp: IntArray, frame_length: int) -> bytes:
    seconds, nanoseconds = np.divmod(np.asarray(stamp, np.int64), _NANO)
    if np.any((seconds < -(2**31)) | (seconds >= 2**31)):
        raise ValueError("a header stamp does not fit into 32-bit seconds")
    words = np.stack([seconds, nanoseconds, np.full_like(seconds, frame_length)], axis=1)
    return words.astype("<u4").tobytes()
