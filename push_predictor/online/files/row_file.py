# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Rows of bytes on disk, eight bytes of memory each, so that a validator can run for days."""

from __future__ import annotations

import os
import tempfile
import weakref
from array import array
from collections.abc import Iterator, Sequence
from typing import overload


class RowFile(Sequence[bytes]):
    """Rows in a file without a name, in the folder for temporary files; it disappears with the process.

    A row that the disk does not take stays in memory. A negative number counts from the end.
    """

    def __init__(self) -> None:
        self._ends = array("q", [0])
        self._kept: dict[int, bytes] = {}
        self._file: int | None = None

    def append(self, row: bytes) -> None:
        """Append a row."""
        begin = self._ends[-1]
        if not self._written(row, begin):
            self._kept[len(self)] = row
        self._ends.append(begin + len(row))

    def __len__(self) -> int:
        return len(self._ends) - 1

    def __iter__(self) -> Iterator[bytes]:
        return map(self._row, range(len(self)))

    @overload
    def __getitem__(self, number: int) -> bytes: ...
    @overload
    def __getitem__(self, number: slice) -> list[bytes]: ...
    def __getitem__(self, number: int | slice) -> bytes | list[bytes]:
        places = range(len(self))[number]  # raises IndexError
        return self._row(places) if isinstance(places, int) else list(map(self._row, places))

    def _row(self, place: int) -> bytes:
        if (kept := self._kept.get(place)) is not None:
            return kept
        begin, end = self._ends[place], self._ends[place + 1]
        assert self._file is not None
        return os.pread(self._file, end - begin, begin)

    def _written(self, row: bytes, begin: int) -> bool:
        try:
            return os.pwrite(self._opened(), row, begin) == len(row)
        except OSError:
            return False

    def _opened(self) -> int:
        if self._file is None:
            self._file, name = tempfile.mkstemp(prefix="push_rows_")
            os.unlink(name)
            weakref.finalize(self, os.close, self._file)
        return self._file
