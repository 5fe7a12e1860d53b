# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""ROS 2 messages of a recording, as dictionaries of their fields, and their definitions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from benchmarks.foreign.arrays import Floats, Integers

POSE_STAMPED = "geometry_msgs/msg/PoseStamped"
WRENCH_STAMPED = "geometry_msgs/msg/WrenchStamped"
FLOAT64 = "std_msgs/msg/Float64"
SECOND = 1_000_000_000  # ns
Message = dict[str, Any]


def definition(type_name: str) -> str:
    """The `ros2msg` definition of a message type of ROS 2 Jazzy, with the types that it contains."""
    return str(get_typestore(Stores.ROS2_JAZZY).generate_msgdef(type_name, ros_version=2)[0])


def poses(stamps: Integers, values: Floats) -> Iterator[Message]:
    """PoseStamped from rows (x, y, z, yaw), m and rad; stamps in ns."""
    half = values[:, 3] / 2
    numbers = np.column_stack([_short(values[:, :3]), np.sin(half), np.cos(half)]).tolist()
    for stamp, (x, y, z, sine, cosine) in zip(stamps.tolist(), numbers, strict=True):
        orientation = {"x": 0.0, "y": 0.0, "z": sine, "w": cosine}
        yield {"header": _header(stamp), "pose": {"position": _vector(x, y, z), "orientation": orientation}}


def wrenches(stamps: Integers, values: Floats) -> Iterator[Message]:
    """WrenchStamped from rows (force, torque), N and N m; stamps in ns."""
    for stamp, row in zip(stamps.tolist(), _short(values).tolist(), strict=True):
        yield {"header": _header(stamp), "wrench": {"force": _vector(*row[:3]), "torque": _vector(*row[3:])}}


def scalars(values: Floats) -> Iterator[Message]:
    """Float64 from the first column."""
    for value in values[:, 0].tolist():
        yield {"data": value}


def _header(stamp: int) -> Message:
    seconds, nanoseconds = divmod(stamp, SECOND)
    return {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": "world"}


def _vector(x: float, y: float, z: float) -> Message:
    return {"x": x, "y": y, "z": z}


def _short(values: Floats) -> Floats:
    """Values rounded to single precision, as sensors deliver them; they compress to about half."""
    return values.astype(np.float32).astype(np.float64)
