# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What every file of a bag gives: raw messages, single or many of one topic at a time, and notes on what is lost."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
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
    notes, by default its path.
    """

    def __init__(self, path: Path, name: str = "") -> None:
        self.path, self.name = path, name or str(path)
        self.topics: dict[str, str] = {}
        self.schemas: dict[str, str] = {}
        self.qos: dict[str, str] = {}
        self.metadata: dict[str, Mapping[str, str]] = {}
        self.notes = Notes()

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """CDR messages in file order, of all topics or of the given ones; damage becomes a note."""
        raise NotImplementedError

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
