# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Write a recording as a rosbag2 bag for `ros2 bag play`, Foxglove and the mcap tool."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from push_predictor.errors import RecordingError
from push_predictor.geometry.frames import quaternion_of_yaw
from push_predictor.recordings.bag.message_types import FLOAT64, POSE, WRENCH, MessageType
from push_predictor.recordings.bag.messages import encode
from push_predictor.recordings.bag.writer import BagWriter
from push_predictor.recordings.rig import RECORD_NAME
from push_predictor.recordings.streams import PoseStream, Recording, ScalarStream, WrenchStream
from push_predictor.recordings.topics import DEFAULT_TOPICS
from push_predictor.types import IntArray

__all__ = ["BagWriter", "write_recording"]


class _Encoded(NamedTuple):
    topic: str
    type: MessageType
    log_time: IntArray
    messages: list[bytes]


def write_recording(path: Path, recording: Recording, *, compression: str = "zstd") -> None:
    """Write a recording to a folder, or to a bare file if path ends in .mcap; an earlier bag is replaced.

    compression: 'zstd', 'lz4' or 'none'. A folder contains metadata.yaml and NAME_0.mcap. Poses get frame_id 'world'
    and their tilt as a roll, which `check` judges; scalars become std_msgs/Float64. Messages are in order of log time.
    The log time is the header stamp, or the latest stamp so far where stamps go back, so that the order is kept. Raises
    RecordingError.
    """
    topics = _encoded(recording)
    with BagWriter(path, compression=compression) as writer:
        if recording.rig is not None:
            writer.add_metadata(RECORD_NAME, recording.rig.to_record())
        for name, kind, _, _ in topics:
            writer.add_topic(name, kind.name, kind.definition, type_hash=kind.type_hash)
        for name, stamp, data in _in_order(topics):
            writer.write(name, stamp, data)


def _encoded(recording: Recording) -> list[_Encoded]:
    names = DEFAULT_TOPICS
    try:
        topics = [_pose(names.slider, recording.slider), _pose(names.pusher, recording.pusher)]
        if recording.wrench is not None:
            topics.append(_wrench(names.wrench, recording.wrench))
        return topics + [_scalar(name, stream) for name, stream in recording.scalars.items()]
    except ValueError as error:
        raise RecordingError(f"{recording.name}: cannot be written ({error})") from None


def _pose(name: str, stream: PoseStream) -> _Encoded:
    z, w = quaternion_of_yaw(stream.heading)
    roll, upright = quaternion_of_yaw(np.zeros(len(stream)) if stream.tilt is None else stream.tilt)
    x, y = w * roll + 0.0, z * roll + 0.0  # without negative zeros: bags of equal recordings have equal bytes
    values = np.stack([stream.x, stream.y, stream.z, x, y, z * upright, w * upright], axis=1)
    return _Encoded(name, POSE, _arrival(stream.stamp), encode(stream.stamp, values))


def _wrench(name: str, stream: WrenchStream) -> _Encoded:
    none = np.zeros(len(stream))
    values = np.stack([stream.fx, stream.fy, none, none, none, stream.torque], axis=1)
    return _Encoded(name, WRENCH, _arrival(stream.stamp), encode(stream.stamp, values))


def _scalar(name: str, stream: ScalarStream) -> _Encoded:
    messages = encode(stream.stamp, stream.value[:, None], header=False)
    return _Encoded(name, FLOAT64, stream.stamp, messages)


def _arrival(stamp: IntArray) -> IntArray:
    return np.maximum.accumulate(stamp) if len(stamp) else stamp


def _in_order(topics: list[_Encoded]) -> Iterator[tuple[str, int, bytes]]:
    """(topic, log time, message) in order of log time, then of topics, then as given."""
    stamp = np.concatenate([topic.log_time for topic in topics])
    source = np.repeat(np.arange(len(topics)), [len(topic.messages) for topic in topics])
    order = np.argsort(stamp, kind="stable")
    data = [message for topic in topics for message in topic.messages]
    for i, k, t in zip(order.tolist(), source[order].tolist(), stamp[order].tolist(), strict=True):
        yield topics[k].topic, t, data[i]
