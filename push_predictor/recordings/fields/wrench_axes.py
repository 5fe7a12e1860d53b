# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Wrenches measured along the axes of a sensor, along those of the world and about the tip, many at a time.

Offline and online use: `poses_at` of pose_rows gives the sensor's pose at the stamp of each wrench.
"""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.fields.pose_rows import inverted, turned
from push_predictor.types import Array


def in_world_axes(wrenches: Array, poses: Array) -> Array:
    """Wrenches (n, 6: force N, torque N m) along a sensor's axes, along the world's; the torque keeps its point.

    poses (n, 7): of the sensor in the world, x, y, z (m) and a unit quaternion x, y, z, w, as in pose_rows.
    """
    quaternion = poses[:, 3:]
    return np.hstack([turned(quaternion, wrenches[:, :3]), turned(quaternion, wrenches[:, 3:])])


def in_sensor_axes(wrenches: Array, poses: Array) -> Array:
    """Wrenches (n, 6) along the world's axes, along those of sensors at poses (n, 7): the inverse of in_world_axes."""
    return in_world_axes(wrenches, inverted(poses))


def at_tip(wrenches: Array, sensor: Array, tip: Array) -> Array:
    """Wrenches (n, 6) along a sensor's axes, along the world's and about the tip; sensor, tip: their poses (n, 7)."""
    return about_points(in_world_axes(wrenches, sensor), sensor[:, :3], tip[:, :3])


def about_points(wrenches: Array, origins: Array, points: Array) -> Array:
    """Wrenches (n, 6) whose torque is about origins (n, 3) m, with their torque about points (n, 3) m.

    All are along the same axes.
    """
    force = wrenches[:, :3]
    return np.hstack([force, wrenches[:, 3:] + np.cross(origins - points, force)])
