# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Columns of numbers as CDR messages (XCDR1, little-endian), many at a time.

A message here is an optional std_msgs/Header (stamp, frame_id), followed by numbers of one size. Numbers are aligned to
their size, counted from the fourth byte, so their position depends on the length of frame_id.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array, IntArray

_PREFIX = 4  # bytes of encapsulation: 0, 1 little-endian or 0, 0 big-endian, then two of options
_STAMP, _FRAME = 4, 16
_NANO = 1_000_000_000


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
SCALAR_LAYOUT = Layout(header=False, count=1)  # of std_msgs/Float64
STAMPED_SCALAR_LAYOUT = Layout(header=True, count=1)  # of sensor_msgs/Temperature, up to its variance


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


def _header_words(stamp: IntArray, frame_length: int) -> bytes:
    seconds, nanoseconds = np.divmod(np.asarray(stamp, np.int64), _NANO)
    if np.any((seconds < -(2**31)) | (seconds >= 2**31)):
        raise ValueError("a header stamp does not fit into 32-bit seconds")
    words = np.stack([seconds, nanoseconds, np.full_like(seconds, frame_length)], axis=1)
    return words.astype("<u4").tobytes()
