"""Sensor messages gathered into the library's streams, portion by portion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

import numpy as np

from msg_adapters import MessageError
from msg_adapters.poses import PlanarPose, PlanarWrench
from push_predictor.recordings.streams import PoseStream, WrenchStream

Sample = TypeVar("Sample", PlanarPose, PlanarWrench)


class Inbox(Generic[Sample]):
    """Messages of one topic as samples; a message that cannot be taken is counted, and its reason kept."""

    def __init__(self, convert: Callable[[Any], Sample]) -> None:
        self.received = 0
        self.rejected = 0
        self.last_reason = ""
        self._convert: Callable[[Any], Sample] = convert
        self._samples: list[Sample] = []

    def put(self, message: Any) -> None:
        """Take a message."""
        self.received += 1
        try:
            self._samples.append(self._convert(message))
        except MessageError as error:
            self.rejected += 1
            self.last_reason = str(error)

    def take(self) -> list[Sample]:
        """The samples since the last call."""
        samples, self._samples = self._samples, []
        return samples


def pose_stream(samples: list[PlanarPose]) -> PoseStream:
    """The samples as one stream."""
    rows = np.array([(s.x, s.y, s.z, s.yaw) for s in samples], dtype=np.float64).reshape(-1, 4)
    return PoseStream(np.array([s.stamp_ns for s in samples], dtype=np.int64), *rows.T)


def wrench_stream(samples: list[PlanarWrench]) -> WrenchStream:
    """The samples as one stream."""
    rows = np.array([(s.fx, s.fy, s.torque) for s in samples], dtype=np.float64).reshape(-1, 3)
    return WrenchStream(np.array([s.stamp_ns for s in samples], dtype=np.int64), *rows.T)
