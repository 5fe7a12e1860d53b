# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Sensor messages of planar poses and wrenches, as a tracker and a force sensor would publish them."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped

from msg_adapters import ns_to_stamp
from push_predictor.geometry.frames import quaternion_of_yaw


def pose_message(stamp: int, x: float, y: float, z: float, yaw: float) -> PoseStamped:
    """A pose in frame world, turned by yaw (rad) about the vertical; stamp in ns, x, y, z in m."""
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = ns_to_stamp(stamp), "world"
    position, turn = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = float(x), float(y), float(z)
    turn_z, turn_w = quaternion_of_yaw(np.asarray(yaw))
    turn.x, turn.y, turn.z, turn.w = 0.0, 0.0, float(turn_z), float(turn_w)
    return message


def wrench_message(stamp: int, fx: float, fy: float, torque: float) -> WrenchStamped:
    """A wrench in frame world: force in the plane (N), torque about the vertical (N m); stamp in ns."""
    message = WrenchStamped()
    message.header.stamp, message.header.frame_id = ns_to_stamp(stamp), "world"
    message.wrench.force.x, message.wrench.force.y = float(fx), float(fy)
    message.wrench.torque.z = float(torque)
    return message
