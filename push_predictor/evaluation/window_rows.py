"""Many windows in little memory: a validator that runs for a day keeps all it has seen."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from typing import overload

import numpy as np

from push_predictor.recordings.windows import PushWindow

_FIXED = struct.Struct("<3q14d")


class WindowRows(Sequence[PushWindow]):
    """Windows packed into a fifth of the memory of their objects, which are made anew when asked for."""

    def __init__(self) -> None:
        self._rows: list[tuple[str, tuple[str, ...], bytes]] = []
        self._names: dict[tuple[str, ...], tuple[str, ...]] = {}

    def append(self, window: PushWindow) -> None:
        """Take a window."""
        names = tuple(window.covariates)
        self._rows.append((window.push_id, self._names.setdefault(names, names), _packed(window)))

    def take(self, numbers: Iterable[int]) -> WindowRows:
        """Some of the windows, in the order of the numbers."""
        chosen = WindowRows()
        chosen._rows = [self._rows[number] for number in numbers]
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
        return _unpacked(*self._rows[number])


def _packed(w: PushWindow) -> bytes:
    poses = (*w.displacement, *w.slider_start, *w.slider_end)
    fixed = _FIXED.pack(w.index, w.start, w.end, w.velocity, w.contact, w.angle, w.duration, *poses, w.push_heading)
    return fixed + struct.pack(f"<{len(w.covariates)}d", *w.covariates.values())


def _unpacked(push_id: str, names: tuple[str, ...], data: bytes) -> PushWindow:
    index, start, end, velocity, contact, angle, duration, *poses, heading = _FIXED.unpack_from(data)
    displacement, slider_start, slider_end = np.array(poses).reshape(3, 3)
    covariates = struct.unpack_from(f"<{len(names)}d", data, _FIXED.size)
    return PushWindow(
        push_id,
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
        dict(zip(names, covariates, strict=True)),
    )
