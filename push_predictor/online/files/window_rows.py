# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A sequence of windows stored on disk: all windows of a day do not fit into memory."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from typing import overload

import numpy as np

from push_predictor.online.files.row_file import RowFile
from push_predictor.recordings.windows.push_window import PushWindow

_FIXED = struct.Struct("<3q14d2H")  # the last two: number of the covariates' names, length of the push's id


class WindowRows(Sequence[PushWindow]):
    """Windows packed into rows of a file; indexing creates the objects again."""

    def __init__(self) -> None:
        self._rows: RowFile | list[bytes] = RowFile()
        self._names: list[tuple[str, ...]] = []  # of the covariates, as sets of them occurred

    def append(self, window: PushWindow) -> None:
        """Append a window."""
        names = tuple(window.covariates)
        if names not in self._names:
            self._names.append(names)
        self._rows.append(_packed(window, self._names.index(names)))

    def take(self, numbers: Iterable[int]) -> WindowRows:
        """Some of the windows, in the order of the numbers; in memory, so that a process can receive them."""
        chosen = WindowRows()
        chosen._rows, chosen._names = [self._rows[number] for number in numbers], self._names.copy()
        return chosen

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, number: int) -> PushWindow: ...
    @overload
    def __getitem__(self, number: slice) -> WindowRows: ...
    def __getitem__(self, number: int | slice) -> PushWindow | WindowRows:
        if isinstance(number, slice):
            return self.take(range(*number.indices(len(self))))
        return _unpacked(self._rows[number], self._names)


def _packed(w: PushWindow, names: int) -> bytes:
    poses, push = (*w.displacement, *w.slider_start, *w.slider_end), w.push_id.encode()
    numbers = (w.velocity, w.contact, w.angle, w.duration, *poses, w.push_heading)
    fixed = _FIXED.pack(w.index, w.start, w.end, *numbers, names, len(push))
    return fixed + push + struct.pack(f"<{len(w.covariates)}d", *w.covariates.values())


def _unpacked(data: bytes, known: Sequence[tuple[str, ...]]) -> PushWindow:
    index, start, end, velocity, contact, angle, duration, *poses, heading, number, length = _FIXED.unpack_from(data)
    displacement, slider_start, slider_end = np.array(poses).reshape(3, 3)
    names, rest = known[number], _FIXED.size + length
    return PushWindow(
        data[_FIXED.size : rest].decode(),
        index,
        start,
        end,
        velocity,
        contact,
        angle,
        duration,
        displacement,
        slider_start,
        slider_end,
        heading,
        dict(zip(names, struct.unpack_from(f"<{len(names)}d", data, rest), strict=True)),
    )
