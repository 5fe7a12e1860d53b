# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A force sensor on a tip that turns about a tilted axis, for the recordings of lab_bags."""

from __future__ import annotations

from typing import Any

import numpy as np
from lab_bags import Lab

from push_predictor.recordings.fields.pose_rows import about_points, composed, in_world_axes, inverted, normalised
from push_predictor.recordings.streams import PoseStream, WrenchStream
from push_predictor.types import Array, IntArray

TILT = 0.35  # rad, of the axis from the vertical
TURN = 0.8  # rad/s
MOUNT = normalised(np.array([[0.02, -0.03, 0.11, 0.2, 0.1, 0.9, 0.3]]))  # of the sensor in the tip's frame


def in_sensor_axes(wrenches: Array, poses: Array) -> Array:
    """Wrenches (n, 6) along the world's axes, along those of sensors at poses (n, 7): the inverse of in_world_axes."""
    return in_world_axes(wrenches, inverted(poses))


def tip_rows(pusher: PoseStream, stamp: IntArray, tilt: float = TILT) -> Array:
    """Poses (n, 7) of the tip: its recorded positions, a tool that points down and turns about an axis."""
    known = np.unique(pusher.stamp, return_index=True)[1]
    begin = pusher.stamp[0]  # a float has no room for the nanoseconds of a date
    at, of = stamp - begin, pusher.stamp[known] - begin
    x, y, z = (np.interp(at, of, column[known]) for column in (pusher.x, pusher.y, pusher.z))
    half = 0.5 * TURN * 1e-9 * at
    none = np.zeros(len(stamp))
    axis = np.sin(half)[:, None] * [np.sin(tilt), 0.0, np.cos(tilt)]
    turns = np.column_stack([none, none, none, axis, np.cos(half)])
    down = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (len(stamp), 1))
    return np.column_stack([x, y, z, composed(turns, down)[:, 3:]])


def wrench_rows(wrench: WrenchStream) -> Array:
    """Wrenches (n, 6) along the world's axes; their vertical force and horizontal torque are not zero."""
    none = np.zeros(len(wrench))
    return np.column_stack([wrench.fx, wrench.fy, none - 2.0, none + 0.03, none - 0.02, wrench.torque])


def add_tip(lab: Lab, topic: str, stamp: IntArray, rows: Array) -> None:
    """Poses of a tip as PoseStamped."""
    lab.poses(topic, "geometry_msgs/msg/PoseStamped", stamp, rows, "pose")


def add_wrench(lab: Lab, topic: str, stamp: IntArray, values: Array, frame: str) -> None:
    """Wrenches (n, 6) as WrenchStamped in a frame."""
    names = [f"wrench.{part}.{axis}" for part in ("force", "torque") for axis in "xyz"]
    pairs: Any = zip(stamp.tolist(), values.tolist(), strict=True)
    lab.add(topic, "geometry_msgs/msg/WrenchStamped", stamp, (
        {**lab.header(at), "header.frame_id": frame, **dict(zip(names, row, strict=True))} for at, row in pairs
    ))  # fmt: skip


def measured_at_tip(wrench: WrenchStream, pusher: PoseStream, tilt: float = TILT) -> Array:
    """What a sensor at the tip with its axes measures (n, 6)."""
    return in_sensor_axes(wrench_rows(wrench), tip_rows(pusher, wrench.stamp, tilt))


def measured_at_mount(wrench: WrenchStream, pusher: PoseStream) -> Array:
    """What a sensor at MOUNT above the tip measures (n, 6), its torque about its own origin."""
    return measured_at(wrench, tip_rows(pusher, wrench.stamp))


def measured_at(wrench: WrenchStream, tip: Array) -> Array:
    """What a sensor at MOUNT above a tip with poses (n, 7) measures (n, 6)."""
    sensor = composed(tip, np.repeat(MOUNT, len(tip), axis=0))
    return in_sensor_axes(about_points(wrench_rows(wrench), tip[:, :3], sensor[:, :3]), sensor)


def sensor_tf(lab: Lab, pusher: PoseStream, base: Array, world: str = "world") -> None:
    """Frames of tf: the world, a static base (1, 7), the tip `tool0` in it, and the sensor `ft` on the tip."""
    rows = tip_rows(pusher, pusher.stamp)
    in_base = composed(inverted(np.repeat(base, len(rows), axis=0)), rows)
    lab.transform("/tf_static", world, "base", pusher.stamp[:1], base)
    lab.transform("/tf_static", "tool0", "ft", pusher.stamp[:1], MOUNT)
    lab.transform("/tf", "base", "tool0", pusher.stamp, in_base)
