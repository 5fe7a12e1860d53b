# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Columns of numbers to and from CDR messages (XCDR1, either byte order), many at a time.

A message here is an optional std_msgs/Header (stamp, frame_id), followed by numbers of one size. Numbers are aligned to
their size, counted from the fourth byte, so their position depends on the length of frame_id.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from push_predictor.types import Array, BoolArray, IntArray

_PREFIX = 4  # bytes of encapsulation: 0, 1 little-endian or 0, 0 big-endian, then two of options
_STAMP, _FRAME = 4, 16
_NANO = 1_000_000_000
_Bytes = NDArray[np.uint8]


@dataclass(frozen=True)
class Layout:
    """The layout of a message type: an optional std_msgs/Header, then numbers of one size.

    header: whether there is one; count: of the numbers; size: of a number, 8 or 4 bytes.
    """

    header: bool
    count: int
    size: int = 8

    def start(self, frame_length: int) -> int:
        """The byte at which the numbers start; frame_length: bytes of frame_id with its closing zero."""
        end = _FRAME + frame_length - _PREFIX if self.header else 0
        return _PREFIX + -(-end // self.size) * self.size


POSE_STAMPED = Layout(header=True, count=7)
WRENCH_STAMPED = Layout(header=True, count=6)


@dataclass(frozen=True, eq=False)
class Columns:
    """n decoded messages.

    stamp (n,) in ns, zero without a header; values (n, count); valid (n,): readable; frames: frame_ids found.
    """

    stamp: IntArray
    values: Array
    valid: BoolArray
    frames: frozenset[str]


def decode(messages: Sequence[bytes], layout: Layout) -> Columns:
    """Decode messages of one type.

    A message that is too short or not XCDR1 is not valid and has a row of zeros.
    """
    n = len(messages)
    stamp, values, valid = np.zeros(n, np.int64), np.zeros((n, layout.count)), np.zeros(n, bool)
    frames: set[str] = set()
    for rows, block, order, frame_length in _groups(messages, layout):
        start = layout.start(frame_length)
        numbers = block[:, start : start + layout.count * layout.size]
        with np.errstate(invalid="ignore"):  # widening a signalling NaN
            values[rows] = np.ascontiguousarray(numbers).view(f"{order}f{layout.size}")
        valid[rows] = True
        if layout.header:
            seconds, nanoseconds = _word(block, _STAMP, order, "i"), _word(block, _STAMP + 4, order, "u")
            stamp[rows] = seconds.astype(np.int64) * _NANO + nanoseconds
            valid[rows] = nanoseconds < _NANO
            frames |= _texts(block[:, _FRAME : _FRAME + frame_length])
    return Columns(stamp, values, valid, frozenset(frames))


def encode(stamp: IntArray, values: Array, layout: Layout, frame_id: str = "world") -> list[bytes]:
    """Encode one little-endian message per row of values (n, count).

    stamp (n,) in ns is unused without a header. Raises ValueError for a stamp outside the range of
    builtin_interfaces/Time.
    """
    text = frame_id.encode() + b"\0"
    start = layout.start(len(text))
    size = start + layout.count * layout.size
    block = np.zeros((len(values), size), np.uint8)
    block[:, 1] = 1
    if layout.header:
        block[:, _STAMP:_FRAME] = np.frombuffer(_header_words(stamp, len(text)), np.uint8).reshape(-1, 12)
        block[:, _FRAME : _FRAME + len(text)] = np.frombuffer(text, np.uint8)
    numbers = np.ascontiguousarray(values, f"<f{layout.size}").view(np.uint8)
    block[:, start:] = numbers.reshape(len(values), size - start)
    data = block.tobytes()
    return [data[i : i + size] for i in range(0, len(data), size)]


def frame_of(message: bytes) -> str:
    """The frame_id of a readable message that begins with a header."""
    length = int.from_bytes(message[_FRAME - 4 : _FRAME], "little" if message[1] else "big")
    return message[_FRAME : _FRAME + length].rstrip(b"\0").decode(errors="replace")


def _header_words(stamp: IntArray, frame_length: int) -> bytes:
    seconds, nanoseconds = np.divmod(np.asarray(stamp, np.int64), _NANO)
    if np.any((seconds < -(2**31)) | (seconds >= 2**31)):
        raise ValueError("a header stamp does not fit into 32-bit seconds")
    words = np.stack([seconds, nanoseconds, np.full_like(seconds, frame_length)], axis=1)
    return words.astype("<u4").tobytes()


def _groups(messages: Sequence[bytes], layout: Layout) -> Iterator[tuple[IntArray, _Bytes, str, int]]:
    """(rows, bytes (k, length), byte order, length of frame_id) of readable messages that share the last three."""
    lengths = np.fromiter(map(len, messages), np.int64, len(messages))
    for length in np.unique(lengths[lengths >= layout.start(0)]):
        same = np.flatnonzero(lengths == length)
        block = np.frombuffer(b"".join([messages[i] for i in same.tolist()]), np.uint8).reshape(-1, length)
        for order, code in (("<", 1), (">", 0)):
            chosen = (block[:, 0] == 0) & (block[:, 1] == code)
            frame_lengths = _word(block, _FRAME - 4, order, "u") if layout.header else np.zeros(len(same))
            for frame_length in np.unique(frame_lengths[chosen]).astype(int).tolist():
                if layout.start(frame_length) + layout.count * layout.size <= length:
                    picked = chosen & (frame_lengths == frame_length)
                    yield same[picked], block[picked], order, frame_length


def _word(block: _Bytes, at: int, order: str, kind: str) -> NDArray[np.integer]:
    return np.ascontiguousarray(block[:, at : at + 4]).view(f"{order}{kind}4")[:, 0]


def _texts(block: _Bytes) -> set[str]:
    rows = block[:1] if len(block) and (block == block[0]).all() else block
    return {row.tobytes().rstrip(b"\0").decode(errors="replace") for row in rows}
