# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Sensor messages of planar poses and wrenches, as a tracker and a force sensor would publish them."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped

from msg_adapters.stamps import ns_to_stamp
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
