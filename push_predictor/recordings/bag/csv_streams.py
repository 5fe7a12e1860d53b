# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A folder of CSV files, one for each stream, as messages of a recording."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from decimal import Decimal, InvalidOperation
from heapq import merge
from pathlib import Path

import numpy as np

from push_predictor.errors import RecordingError
from push_predictor.geometry.frames import quaternion_of_yaw
from push_predictor.recordings.bag.message_types import POSE, WRENCH
from push_predictor.recordings.bag.messages import BagFile, RawMessage, encode
from push_predictor.recordings.bag.spreadsheet import Column, Sheet, column_of, read_sheet, with_point
from push_predictor.types import Array, IntArray

QUATERNION = ("time", "x", "y", "z", "qx", "qy", "qz", "qw")
HEADING = ("time", "x", "y", "z", "heading")
SPATIAL = ("time", "fx", "fy", "fz", "tx", "ty", "tz")
PLANAR = ("time", "fx", "fy", "torque")
STREAMS = {
    "slider": ("/slider/pose", (QUATERNION, HEADING)),
    "pusher": ("/pusher/pose", (QUATERNION, HEADING)),
    "wrench": ("/pusher/wrench", (SPATIAL, PLANAR)),
}
SCALAR = "sensor_msgs/msg/Temperature"  # one number with a header; of another file, its further columns
_LATEST = 2**31 * 10**9  # ns; a header has 32 bits of seconds


class CsvStreams(BagFile):
    """The streams in slider.csv, pusher.csv, wrench.csv and further files.

    time is in s; x, y, z in m; heading in rad; force in N,
    torque in N m. Each further column of another file is a scalar named /FILE/COLUMN. Raises RecordingError that names
    file, line, column, value and what is accepted.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._messages: dict[str, list[RawMessage]] = {}
        for file in _files(folder):
            self._read(read_sheet(file, RecordingError))
        for file in sorted(folder.glob("*.parquet")):
            self.notes.add(f"{file.name} is ignored, convert it to CSV")

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """See BagFile; in order of time, those of a topic in its file's order."""
        wanted = [found for topic, found in self._messages.items() if topics is None or topic in topics]
        return merge(*wanted, key=lambda message: message.log_time)

    def _read(self, sheet: Sheet) -> None:
        try:
            columns = [column_of(text) for text in sheet.header]
        except ValueError as error:
            raise RecordingError(f"{sheet.path} line 1: {error}") from None
        if (stream := sheet.path.stem.lower()) in STREAMS:
            topic, accepted = STREAMS[stream]
            self._add(topic, *self._stream(sheet, columns, accepted))
            return
        if columns[0].name != "time" or len(columns) < 2:
            raise _refused(sheet, "time and further columns")
        stamp = _stamps(sheet, 0, columns[0])
        for place, name in enumerate(sheet.header[1:], start=1):
            self._add(f"/{sheet.path.stem}/{name}", SCALAR, stamp, sheet.numbers(place)[:, None])

    def _stream(
        self, sheet: Sheet, columns: Sequence[Column], accepted: Sequence[Sequence[str]]
    ) -> tuple[str, IntArray, Array]:
        """Message type, stamps (n,) in ns and numbers (n, 6 or 7) of a stream with one of these headers."""
        given = sorted(column.name for column in columns)
        names = next((names for names in accepted if sorted(names) == given), None)
        if names is None:
            raise _refused(sheet, " or ".join(repr(",".join(names)) for names in accepted))
        if converted := [f"{column.name} in {column.unit}" for column in columns if column.factor != 1]:
            self.notes.add(f"{sheet.path.name}: {', '.join(converted)} is converted to SI units")
        time, *others = (next(k for k, column in enumerate(columns) if column.name == name) for name in names)
        stamp = _stamps(sheet, time, columns[time])
        values = np.column_stack([sheet.numbers(place) * float(columns[place].factor) for place in others])
        return (POSE if names in (QUATERNION, HEADING) else WRENCH).name, stamp, _spatial(names, values)

    def _add(self, topic: str, kind: str, stamp: IntArray, values: Array) -> None:
        messages = zip(stamp.tolist(), encode(stamp, values), strict=True)
        self.topics[topic] = kind
        self._messages[topic] = [RawMessage(topic, kind, time, data) for time, data in messages]


def is_csv_recording(folder: Path) -> bool:
    """Whether a folder contains the two streams that a recording needs."""
    return {"slider", "pusher"} <= {file.stem.lower() for file in _files(folder)}


def _files(folder: Path) -> list[Path]:
    return sorted(file for file in folder.iterdir() if file.suffix.lower() == ".csv")


def _refused(sheet: Sheet, accepted: str) -> RecordingError:
    return RecordingError(f"{sheet.path} line 1: the header is {','.join(sheet.header)!r}, give {accepted}")


def _spatial(names: Sequence[str], values: Array) -> Array:
    """The numbers (n, 6 or 7) of a message from those of a stream's columns without the time."""
    none = np.zeros(len(values))
    if names == HEADING:
        z, w = quaternion_of_yaw(values[:, 3])
        return np.column_stack([values[:, :3], none, none, z, w])
    return np.column_stack([values[:, :2], none, none, none, values[:, 2]]) if names == PLANAR else values


def _stamps(sheet: Sheet, place: int, column: Column) -> IntArray:
    """Times (n,) in ns. A float has no room for the nanoseconds of a date, a decimal has."""
    stamp = np.zeros(len(sheet.rows), np.int64)
    for row, cell in enumerate(sheet.cells(place)):
        try:
            found = (Decimal(cell) * column.factor).scaleb(9)
        except InvalidOperation:
            found = Decimal("nan")
        if not found.is_finite() or not 0 <= found < _LATEST:
            raise sheet.wrong(row, place, f"s from 0 to {_LATEST // 10**9}{with_point(cell)}")
        stamp[row] = round(found)
    return stamp
