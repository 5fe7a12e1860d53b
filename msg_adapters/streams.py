"""Serialized sensor messages gathered into the library's streams, by the rules that read_recording keeps."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_predictor.geometry.frames import yaw_of_quaternion
from push_predictor.recordings.bag.cdr import POSE_STAMPED, WRENCH_STAMPED, Layout, decode
from push_predictor.recordings.streams import PoseStream, WrenchStream
from push_predictor.types import Array, BoolArray

LIMIT = 200_000  # messages that wait, a topic: over 13 minutes at 250 Hz, 25 MB
SMALLEST_COMPONENT = 1e-6  # a quaternion with no component above this tells no heading


@dataclass(frozen=True)
class SensorKind:
    """How a topic's messages are laid out, and what makes one useless: {what is wrong: which rows (n,) have it}."""

    layout: Layout
    faults: Mapping[str, Callable[[Array], Any]]


SLIDER = SensorKind(
    POSE_STAMPED,
    {"not finite": lambda rows: ~np.isfinite(rows).all(axis=1), "no orientation": lambda rows: ~_turned(rows)},
)
TIP = SensorKind(POSE_STAMPED, {"not finite": lambda rows: ~np.isfinite(rows[:, :3]).all(axis=1)})
WRENCH = SensorKind(WRENCH_STAMPED, {"not finite": lambda rows: ~np.isfinite(rows[:, [0, 1, 5]]).all(axis=1)})


class MessageBuffer:
    """Serialized messages of one topic until somebody takes them; what cannot be used is counted by kind.

    frame_id: what the headers must name, empty for any. Beyond LIMIT the oldest messages are dropped, and counted.
    """

    def __init__(self, kind: SensorKind, frame_id: str) -> None:
        self.received = 0
        self.dropped = 0
        self.rejected: Counter[str] = Counter()
        self._kind = kind
        self._frame_id = frame_id
        self._waiting: list[bytes] = []
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, data: bytes) -> None:
        """Take a message; any thread may."""
        with self._lock:
            self.received += 1
            self._waiting.append(data)
            if len(self._waiting) > LIMIT:
                excess = LIMIT // 10  # at once, so that a full inbox does not move at every message
                del self._waiting[:excess]
                self.dropped += excess

    def take(self) -> tuple[np.ndarray, Array]:
        """Stamps (n,) in ns and numbers (n, k) of the usable messages since the last call."""
        with self._lock:
            waiting, self._waiting = self._waiting, []
        columns = decode(waiting, self._kind.layout)
        usable = columns.valid.copy()
        self._reject("unreadable", ~columns.valid)
        if self._frame_id and columns.frames - {self._frame_id}:
            usable &= self._count_out("frame_id", usable, np.array([_frame(d) != self._frame_id for d in waiting]))
        for kind, test in self._kind.faults.items():
            usable &= self._count_out(kind, usable, test(columns.values))
        return columns.stamp[usable], columns.values[usable]

    def _count_out(self, kind: str, usable: BoolArray, faulty: BoolArray) -> BoolArray:
        self._reject(kind, usable & faulty)
        return ~faulty

    def _reject(self, kind: str, rows: BoolArray) -> None:
        if count := int(np.sum(rows)):
            self.rejected[kind] += count


def slider_stream(stamp: np.ndarray, rows: Array) -> PoseStream:
    """Poses (n, 7) that have an orientation, of any length."""
    scaled = rows[:, 3:] / np.abs(rows[:, 3:]).max(axis=1, keepdims=True)
    unit = scaled / np.linalg.norm(scaled, axis=1, keepdims=True)
    x, y, z = rows[:, :3].T.copy()
    return PoseStream(stamp, x, y, z, yaw_of_quaternion(*unit.T))


def tip_stream(stamp: np.ndarray, rows: Array) -> PoseStream:
    """Poses (n, 7) of a point: the orientation is of no use."""
    x, y, z = rows[:, :3].T.copy()
    return PoseStream(stamp, x, y, z, np.zeros(len(rows)))


def wrench_stream(stamp: np.ndarray, rows: Array) -> WrenchStream:
    """Wrenches (n, 6)."""
    return WrenchStream(stamp, *rows[:, [0, 1, 5]].T.copy())


def _turned(rows: Array) -> BoolArray:
    largest = np.abs(rows[:, 3:]).max(axis=1, initial=0.0)
    return np.asarray(np.isfinite(largest) & (largest > SMALLEST_COMPONENT))


def _frame(data: bytes) -> str:
    """The frame_id of a message that begins with a header and could be read."""
    length = int.from_bytes(data[12:16], "little" if data[1] else "big")
    return data[16 : 16 + length].rstrip(b"\0").decode(errors="replace")
