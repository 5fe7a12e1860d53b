# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The cells of a CSV file, also as spreadsheets write it: semicolons, tabs, decimal commas, units in the header.

Numbers get a decimal point where all of the file have a comma. Empty columns at the end and empty rows are left out.
"""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import math
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import NamedTuple

import numpy as np

from push_predictor.errors import PushPredictorError
from push_predictor.types import Array

_ERRORS = (OSError, EOFError, zlib.error, ValueError, csv.Error)  # ValueError: also of text that cannot be decoded
_GZIP = b"\x1f\x8b"
_SEPARATORS = (",", ";", "\t")
_MARKED = re.compile(r"sep=(.)\s*")  # Excel's first line
_WITH_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_WITH_POINT = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")

_NUMBER = {"1": "1", "-": "1"}
_LENGTH = {"m": "1", "cm": "1e-2", "mm": "1e-3", "um": "1e-6", "µm": "1e-6"}
_TIME = {"s": "1", "sec": "1", "seconds": "1", "ms": "1e-3", "us": "1e-6", "µs": "1e-6", "ns": "1e-9"}
_ANGLE = {"rad": "1", "deg": str(math.pi / 180.0), "°": str(math.pi / 180.0), "mrad": "1e-3"}
_FORCE = {"n": "1", "mn": "1e-3", "kn": "1e3"}
_TORQUE = {"nm": "1", "n m": "1", "n*m": "1", "n·m": "1", "nmm": "1e-3", "n mm": "1e-3", "ncm": "1e-2", "mnm": "1e-3"}
UNITS = {
    "time": _TIME,
    **dict.fromkeys("xyz", _LENGTH),
    "heading": _ANGLE,
    **dict.fromkeys(("fx", "fy", "fz"), _FORCE),
    **dict.fromkeys(("tx", "ty", "tz", "torque"), _TORQUE),
    **dict.fromkeys(("qx", "qy", "qz", "qw"), _NUMBER),
}
_NAMED = re.compile(r"(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]")

Rows = list[tuple[int, list[str]]]


@dataclass(frozen=True, eq=False)
class Sheet:
    """The cells of a file: header (k,), rows with k cells each, and their line numbers.

    error: the class of what is raised for cells that are not accepted; it names file and line.
    """

    path: Path
    header: list[str]
    rows: Sequence[Sequence[str]]
    lines: Sequence[int]
    error: type[PushPredictorError]

    def cells(self, column: int) -> list[str]:
        """The cells of a column."""
        return [row[column] for row in self.rows]

    def wrong(self, row: int, column: int, accepted: str) -> PushPredictorError:
        """The error for a cell."""
        name, cell = self.header[column], self.rows[row][column]
        return self.error(f"{self.path} line {self.lines[row]}: column {name} is {cell!r}, give {accepted}")

    def parsed(self, column: int) -> tuple[Array, list[int]]:
        """The numbers (n,) in a column, NaN for an empty cell; and the rows that contain a text instead."""
        values, words = np.full(len(self.rows), np.nan), list[int]()
        for row, cell in enumerate(self.cells(column)):
            try:
                values[row] = float(cell or "nan")
            except ValueError:
                words.append(row)
        return values, words

    def numbers(self, column: int) -> Array:
        """The same of a column that contains only numbers. Raises `error`."""
        values, words = self.parsed(column)
        if words:
            point = with_point(self.rows[words[0]][column])
            raise self.wrong(words[0], column, f"a number{point}, or leave it empty")
        return values


def with_point(cell: str) -> str:
    """What a number with a comma lacks, in a file that has decimal points as well."""
    return " with a decimal point" if "," in cell else ""


def read_sheet(path: Path, error: type[PushPredictorError]) -> Sheet:
    """Read a CSV file, also one that gzip has compressed. Raises `error` unless it has a header and equal rows."""
    try:
        data = path.read_bytes()
        found = cells_of(gzip.decompress(data) if data.startswith(_GZIP) else data)
    except _ERRORS as reason:
        raise error(f"{path}: cannot be read as CSV ({reason})") from None
    if len(found) < 2:
        raise error(f"{path}: contains no rows, give a header and one row for each sample or push")
    (_, header), *others = found
    for line, row in others:
        if len(row) != len(header):
            many = "; numbers with a decimal comma need semicolons between the cells" if len(row) > len(header) else ""
            raise error(f"{path} line {line}: {len(row)} cells, the header has {len(header)}{many}")
    lines, rows = zip(*others, strict=True)
    return Sheet(path, header, rows, lines, error)


def cells_of(data: bytes) -> Rows:
    """The line number and the cells of each row, the header first. Raises ValueError or csv.Error."""
    text = _decoded(data)
    separator, rows = _separator(text), Rows()
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    for row in reader:
        cells = [cell.strip() for cell in row]
        if any(cells) and not (reader.line_num == 1 and _MARKED.fullmatch(text.splitlines()[0])):
            rows.append((reader.line_num, cells))
    if not rows:
        return rows
    rows[0][1][0] = rows[0][1][0].removeprefix("#").strip()  # of a header as numpy.savetxt writes it
    return _with_points(_without_empty_columns(rows), separator)


class Column(NamedTuple):
    """name: in lower case, without the unit; unit: as written, '' without one; factor: to the SI unit."""

    name: str
    unit: str = ""
    factor: Decimal = Decimal(1)


def column_of(text: str) -> Column:
    """The column that a cell of the header names. Raises ValueError, which states the units, for an unknown one."""
    found = _NAMED.fullmatch(text.strip())
    name = (found[1] if found else text.strip()).lower()
    if found is None or name not in UNITS:
        return Column(text.strip().lower())
    if (factor := UNITS[name].get(found[2].lower())) is None:
        raise ValueError(f"column {text!r} has an unknown unit, give {', '.join(UNITS[name])}")
    return Column(name, found[2], Decimal(factor))


def _decoded(data: bytes) -> str:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError("it is not UTF-8 text; save it as CSV UTF-8") from None


def _separator(text: str) -> str:
    """The character that separates the cells of the header."""
    first = next((line for line in text.splitlines() if line.strip()), "")
    if marked := _MARKED.fullmatch(first):
        return marked[1]
    return max(_SEPARATORS, key=first.count)


def _without_empty_columns(rows: Rows) -> Rows:
    """Without the empty cells at the end of each row, beyond the last name of the header."""
    width = max((number for number, name in enumerate(rows[0][1], start=1) if name), default=1)
    ends = (max((number for number, cell in enumerate(cells, start=1) if cell), default=0) for _, cells in rows)
    return [(line, cells[: max(width, end)]) for (line, cells), end in zip(rows, ends, strict=True)]


def _with_points(rows: Rows, separator: str) -> Rows:
    """With decimal points, if numbers have a comma and none has a point."""
    cells = {cell for _, row in rows[1:] for cell in row if "," in cell or (separator != "," and "." in cell)}
    if not any(map(_WITH_COMMA.fullmatch, cells)) or any(map(_WITH_POINT.fullmatch, cells)):
        return rows
    changed = {cell: cell.replace(",", ".") for cell in cells if _WITH_COMMA.fullmatch(cell)}
    return [rows[0], *((line, [changed.get(cell, cell) for cell in row]) for line, row in rows[1:])]
