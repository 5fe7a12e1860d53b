# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The messages of one source until they are taken as columns."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.decoder.rules import NO_ELEMENT, OTHER_FRAME, UNREADABLE, Rules, broken, usable
from push_predictor.recordings.fields.sources import (
    Columns,
    FieldReader,
    Source,
    Target,
    definitions_of,
    field_to_read,
)
from push_predictor.recordings.streams import joined, taken
from push_predictor.types import IntArray

_Part: TypeAlias = tuple[Messages | Columns, IntArray | None]  # and when they arrived, of a live topic
_Recent: TypeAlias = tuple[IntArray, IntArray, frozenset[str]]  # stamps, when they arrived, frames
LIMIT = 200_000  # live messages that wait: over 13 minutes at 250 Hz
RECENT = 250  # samples that are kept for the report about a live topic


class TopicInput:
    """received: number of messages. rejected: unusable ones by fault; foreign: those of another type, by type.

    named: the frames that headers have named; expected: the one that they must name, '' for any. dropped: messages of
    a live topic that nobody took in time. from_log: samples have the time of receipt, or of the log.
    `put` may be called in any thread, the others in one.
    """

    def __init__(self, source: Source, target: Target, expected: str = "", from_log: bool = False) -> None:
        self.source, self.target, self.expected, self._from_log = source, target, expected, from_log
        self.kind = ""
        self.received = self.dropped = 0
        self.rejected: Counter[str] = Counter()
        self.foreign: Counter[str] = Counter()
        self.named: frozenset[str] = frozenset()
        self._reader: FieldReader | None = None
        self._waiting: list[_Part] = []
        self._count = 0  # of the messages that wait
        self._recent: list[_Recent] = []
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return self._count

    @property
    def names(self) -> list[str]:
        """By what elements could be chosen in messages that lack the chosen one."""
        return sorted(self._reader.names) if self._reader is not None else []

    @property
    def timed(self) -> bool:
        """Whether messages contain their time, as far as their type is known."""
        return self._reader is not None and self._reader.timed

    def check(self, kind: str, schemas: Mapping[str, str], where: object = "") -> str:
        """The field of a type that is read. schemas: {type: definition}; where: the bag in errors, '' for live topics.

        Raises RecordingError for a type without what the stream needs.
        """
        return field_to_read(self.source, kind, self.target, schemas, where)

    def declare(self, kind: str, schemas: Mapping[str, str], where: object = "") -> None:
        """State the type of the messages from now on, see `check`."""
        field = self.check(kind, schemas, where)
        reader = FieldReader(self.target, kind, field, definitions_of(kind, schemas), self._from_log)
        with self._lock:  # messages of an earlier type cannot be read as those of the new one
            old = sum(len(part) for part, _ in self._waiting if isinstance(part, Messages))
            self._waiting = [each for each in self._waiting if isinstance(each[0], Columns)]
            self.dropped, self._count = self.dropped + old, self._count - old
            self.kind, self._reader, self._recent = kind, reader, []

    def put(self, messages: Messages, arrived: IntArray | None = None) -> None:
        """Add messages. arrived (n,): when they were received, ns, of a live topic."""
        if self._from_log and arrived is not None:
            messages = replace(messages, times=arrived)
        if messages.type != self.kind:
            self.foreign[messages.type] += len(messages)
            return
        with self._lock:
            self.received += len(messages)
            self._count += len(messages)
            self._waiting.append((messages, arrived))
            self._drop_oldest()

    def take(self) -> Columns:
        """The columns of the messages since the last call."""
        parts = [columns for columns, _ in self._decoded()]
        return joined(parts or [Columns.unread(np.empty(0, np.int64), self.target.count)])

    def usable(self, rules: Rules) -> Columns:
        """Of `take` those that are readable, in the expected frame and break no rule; the others are rejected."""
        columns = self.take()
        faults = {NO_ELEMENT: columns.absent, UNREADABLE: ~columns.valid}
        if self.expected and self.timed:
            faults[OTHER_FRAME] = np.asarray(columns.frame != self.expected, np.bool_)
        return taken(columns, usable(faults | broken(columns.values, rules), self.rejected))

    def recent(self) -> tuple[IntArray, IntArray, frozenset[str]]:
        """Stamps (n,) and times of receipt (n,) in ns of the last readable messages, and the frames that they name."""
        decoded = self._decoded()
        with self._lock:  # messages that came meanwhile are newer
            self._waiting[:0] = decoded
            self._count += sum(len(columns) for columns, _ in decoded)
            self._drop_oldest()
        stamp, arrived = (
            np.concatenate([np.empty(0, np.int64), *of]) for of in ([r[k] for r in self._recent] for k in (0, 1))
        )
        return stamp[-RECENT:], arrived[-RECENT:], frozenset[str]().union(*(frames for _, _, frames in self._recent))

    def _drop_oldest(self) -> None:
        """Of a live topic, beyond LIMIT."""
        while self._count > LIMIT and self._waiting and self._waiting[0][1] is not None:
            old = len(self._waiting.pop(0)[0])
            self.dropped, self._count = self.dropped + old, self._count - old

    def _decoded(self) -> list[tuple[Columns, IntArray | None]]:
        """What waited, as columns; it waits no longer."""
        with self._lock:
            waiting, reader = self._waiting, self._reader
            self._waiting, self._count = [], 0
        found: list[tuple[Columns, IntArray | None]] = []
        for part, arrived in waiting:
            if isinstance(part, Messages):
                assert reader is not None, "messages wait only once their type is declared"
                part = reader.read(part)
                self.named |= part.named
                if arrived is not None:
                    self._recent.append((part.stamp[part.valid], arrived[part.valid], part.named))
            found.append((part, arrived))
        while self._recent and sum(len(stamp) for stamp, _, _ in self._recent[1:]) >= RECENT:
            self._recent.pop(0)
        return found
