# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A folder of CSV or Parquet files, one for each stream, as messages of a recording."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from decimal import Decimal, InvalidOperation
from heapq import merge
from pathlib import Path

import numpy as np

from push_predictor.errors import RecordingError
from push_predictor.geometry.frames import quaternion_of_yaw
from push_predictor.recordings.bag.message_types import POSE, WRENCH
from push_predictor.recordings.bag.messages import BagFile, Notes, RawMessage, encode
from push_predictor.recordings.bag.spreadsheet import ERRORS, Column, cells_of, column_of
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
PARQUET = (
    "Parquet files need the package pyarrow (pip install pyarrow); or convert each to CSV: "
    "python -c \"import pandas; pandas.read_parquet('slider.parquet').to_csv('slider.csv', index=False)\""
)
_LATEST = 2**31 * 10**9  # ns; a header has 32 bits of seconds


class CsvStreams(BagFile):
    """The streams in slider.csv, pusher.csv, wrench.csv and further files.

    Each may be a Parquet file with the same columns instead. time is in s; x, y, z in m; heading in rad; force in N,
    torque in N m. Each further column of another file is a scalar named /FILE/COLUMN. Raises RecordingError that names
    file, line, column, value and what is accepted.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._streams: dict[str, tuple[str, IntArray, list[bytes]]] = {}
        for file in _files(folder):
            if file.suffix.lower() == ".csv" or file.stem.lower() in STREAMS or _parquet_is_read():
                self._streams |= _streams(file, self.notes)
            else:
                self.notes.add(f"{file.name} is ignored; {PARQUET}")
        self.topics = {topic: kind for topic, (kind, _, _) in self._streams.items()}

    def messages(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """See BagFile; in order of time, those of a topic in its file's order."""
        wanted = [topic for topic in self._streams if topics is None or topic in topics]
        return merge(*map(self._of_topic, wanted), key=lambda message: message.log_time)

    def _of_topic(self, topic: str) -> Iterator[RawMessage]:
        kind, stamp, data = self._streams[topic]
        return (RawMessage(topic, kind, time, message) for time, message in zip(stamp.tolist(), data, strict=True))


def is_csv_recording(folder: Path) -> bool:
    """Whether a folder contains the two streams that a recording needs."""
    return {"slider", "pusher"} <= {file.stem.lower() for file in _files(folder)}


def _files(folder: Path) -> list[Path]:
    """The files of the streams; of one with both endings the CSV file."""
    files = sorted(folder.iterdir())
    found = {f.stem: f for ending in (".parquet", ".csv") for f in files if f.suffix.lower() == ending}
    return [file for _, file in sorted(found.items())]


def _parquet_is_read() -> bool:
    try:
        import pyarrow.parquet  # noqa: F401 (whether it can be imported is the question)
    except ImportError:
        return False
    return True


def _streams(file: Path, notes: Notes) -> dict[str, tuple[str, IntArray, list[bytes]]]:
    header, rows = _cells(file)
    columns = _columns(file, header)
    if (stream := file.stem.lower()) not in STREAMS:
        if columns[0].name != "time" or len(header) < 2:
            raise RecordingError(f"{file} line 1: the header is {','.join(header)!r}, give time and further columns")
        stamp, values = _numbers(file, header, rows, columns[0].factor)
        scalars = {f"/{file.stem}/{name}": column for name, column in zip(header[1:], values.T, strict=True)}
        return {name: (SCALAR, stamp, encode(stamp, column[:, None])) for name, column in scalars.items()}
    topic, accepted = STREAMS[stream]
    by_name = {column.name: place for place, column in enumerate(columns)}
    names = next((names for names in accepted if {*names} == {*by_name} and len(names) == len(columns)), None)
    if names is None:
        choice = " or ".join(repr(",".join(names)) for names in accepted)
        raise RecordingError(f"{file} line 1: the header is {','.join(header)!r}, give {choice}")
    order = [by_name[name] for name in names]
    _note_units(file, columns, notes)
    factors = [columns[place].factor for place in order]
    in_order = [(line, [row[place] for place in order]) for line, row in rows]
    stamp, values = _numbers(file, [header[place] for place in order], in_order, factors[0])
    kind, spatial = _as_message(names, values * np.array(factors[1:], np.float64))
    return {topic: (kind, stamp, encode(stamp, spatial))}


def _columns(file: Path, header: Sequence[str]) -> list[Column]:
    try:
        return [column_of(text) for text in header]
    except ValueError as error:
        raise RecordingError(f"{file} line 1: {error}") from None


def _note_units(file: Path, columns: Sequence[Column], notes: Notes) -> None:
    """Note the columns that are converted to SI units."""
    if converted := [f"{column.name} in {column.unit}" for column in columns if column.factor != 1]:
        notes.add(f"{file.name}: {', '.join(converted)} is converted to SI units")


def _as_message(header: Sequence[str], values: Array) -> tuple[str, Array]:
    """(message type, its numbers (n, 6 or 7)) of a stream's columns without the time."""
    none = np.zeros(len(values))
    if header == HEADING:
        z, w = quaternion_of_yaw(values[:, 3])
        values = np.column_stack([values[:, :3], none, none, z, w])
    if header == PLANAR:
        values = np.column_stack([values[:, :2], none, none, none, values[:, 2]])
    return (POSE if header in (QUATERNION, HEADING) else WRENCH).name, values


def _cells(file: Path) -> tuple[tuple[str, ...], list[tuple[int, list[str]]]]:
    """The header, and the rows with their line numbers."""
    if file.suffix.lower() == ".parquet":
        return _parquet_cells(file)
    try:
        found = cells_of(file.read_bytes())
    except ERRORS as error:
        raise RecordingError(f"{file}: cannot be read as CSV ({error})") from None
    if len(found) < 2:
        raise RecordingError(f"{file}: contains no rows, give a header and one row for each sample")
    header = tuple(found[0][1])
    for line, row in found[1:]:
        if len(row) != len(header):
            many = "; numbers with a decimal comma need semicolons between the cells" if len(row) > len(header) else ""
            raise RecordingError(f"{file} line {line}: {len(row)} cells, the header has {len(header)}{many}")
    return header, found[1:]


def _parquet_cells(file: Path) -> tuple[tuple[str, ...], list[tuple[int, list[str]]]]:
    """The same of a Parquet file, with the line numbers that it would have as CSV."""
    try:
        from pyarrow import parquet
    except ImportError:
        raise RecordingError(f"{file}: {PARQUET}") from None
    try:
        table = parquet.read_table(file)
        columns = [column.to_pylist() for column in table.columns]
    except Exception as error:  # pyarrow raises its own classes, OSError and ValueError
        raise RecordingError(f"{file}: cannot be read as Parquet ({' '.join(str(error).split())})") from None
    if not table.num_rows:
        raise RecordingError(f"{file}: contains no rows, give one row for each sample")
    cells = (["" if cell is None else str(cell) for cell in row] for row in zip(*columns, strict=True))
    return tuple(table.column_names), list(enumerate(cells, start=2))


def _numbers(
    file: Path, header: Sequence[str], rows: Sequence[tuple[int, list[str]]], seconds: Decimal
) -> tuple[IntArray, Array]:
    """Stamps (n,) in ns and the other columns (n, k); an empty cell is NaN. seconds: unit of the time."""
    stamp, values = np.zeros(len(rows), np.int64), np.zeros((len(rows), len(header) - 1))
    for place, (line, row) in enumerate(rows):
        stamp[place] = _stamp(file, line, row[0], seconds)
        for column, cell in enumerate(row[1:]):
            try:
                values[place, column] = float(cell or "nan")
            except ValueError:
                accepted = f"a number{_with_point(cell)}, or leave it empty"
                raise RecordingError(
                    f"{file} line {line}: column {header[column + 1]} is {cell!r}, give {accepted}"
                ) from None
    return stamp, values


def _stamp(file: Path, line: int, cell: str, seconds: Decimal) -> int:
    """A time in ns. A float has no room for the nanoseconds of a date, a decimal has."""
    try:
        found = (Decimal(cell) * seconds).scaleb(9)
    except InvalidOperation:
        found = Decimal("nan")
    if not found.is_finite() or not 0 <= found < _LATEST:
        accepted = f"s from 0 to {_LATEST // 10**9}{_with_point(cell)}"
        raise RecordingError(f"{file} line {line}: column time is {cell!r}, give {accepted}")
    return round(found)


def _with_point(cell: str) -> str:
    """What a number with a comma lacks, in a file that has decimal points as well."""
    return " with a decimal point" if "," in cell else ""
