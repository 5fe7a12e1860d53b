"""PoseStamped and WrenchStamped <-> planar poses and wrenches (contract, section 2)."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite, sqrt
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped

from msg_adapters import MessageError
from msg_adapters.stamps import ns_to_stamp, stamp_to_ns
from push_predictor.geometry.frames import quaternion_of_yaw, yaw_of_quaternion

WORLD = "world"
NORM_TOLERANCE = 1e-3  # of a unit quaternion; a tracker that writes float32 stays far below


@dataclass(frozen=True)
class PlanarPose:
    """stamp_ns: header stamp, ns. x, y, z in m; yaw in rad, [-pi, pi], counter-clockwise about the vertical."""

    stamp_ns: int
    x: float
    y: float
    z: float
    yaw: float


@dataclass(frozen=True)
class PlanarWrench:
    """stamp_ns: header stamp, ns. fx, fy in N along the world's axes; torque in N m about the vertical at the tip."""

    stamp_ns: int
    fx: float
    fy: float
    torque: float


def pose_from_message(message: Any, frame_id: str | None = WORLD) -> PlanarPose:
    """The planar part of a PoseStamped; roll and pitch are ignored.

    frame_id: the frame the header must name, None for any. Raises MessageError for another frame, a value that is
    not finite, a quaternion that is not of unit length.
    """
    _check_frame(message, frame_id)
    position, turn = message.pose.position, message.pose.orientation
    _check_finite("pose.position", position, "xyz")
    _check_finite("pose.orientation", turn, "xyzw")
    norm = sqrt(turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2)
    if abs(norm - 1.0) > NORM_TOLERANCE:
        raise MessageError("pose.orientation norm", norm, f"a unit quaternion (within {NORM_TOLERANCE:g})")
    yaw = yaw_of_quaternion(*(np.asarray(part) for part in (turn.x, turn.y, turn.z, turn.w)))
    return PlanarPose(stamp_to_ns(message.header.stamp), position.x, position.y, position.z, float(yaw))


def pose_to_message(pose: PlanarPose, frame_id: str = WORLD) -> PoseStamped:
    """A PoseStamped that lies flat: turned by yaw about the vertical, and by nothing else."""
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = ns_to_stamp(pose.stamp_ns), frame_id
    position, turn = message.pose.position, message.pose.orientation
    position.x, position.y, position.z = float(pose.x), float(pose.y), float(pose.z)
    z, w = quaternion_of_yaw(np.asarray(pose.yaw))
    turn.x, turn.y, turn.z, turn.w = 0.0, 0.0, float(z), float(w)
    return message


def wrench_from_message(message: Any, frame_id: str | None = WORLD) -> PlanarWrench:
    """The planar part of a WrenchStamped. Raises MessageError for another frame or a value that is not finite."""
    _check_frame(message, frame_id)
    force, torque = message.wrench.force, message.wrench.torque
    _check_finite("wrench.force", force, "xyz")
    _check_finite("wrench.torque", torque, "xyz")
    return PlanarWrench(stamp_to_ns(message.header.stamp), force.x, force.y, torque.z)


def wrench_to_message(wrench: PlanarWrench, frame_id: str = WORLD) -> WrenchStamped:
    """A WrenchStamped with force in the plane and torque about the vertical."""
    message = WrenchStamped()
    message.header.stamp, message.header.frame_id = ns_to_stamp(wrench.stamp_ns), frame_id
    message.wrench.force.x, message.wrench.force.y = float(wrench.fx), float(wrench.fy)
    message.wrench.torque.z = float(wrench.torque)
    return message


def _check_frame(message: Any, frame_id: str | None) -> None:
    if frame_id is not None and message.header.frame_id != frame_id:
        raise MessageError("header.frame_id", message.header.frame_id, repr(frame_id))


def _check_finite(field: str, vector: Any, axes: str) -> None:
    for axis in axes:
        if not isfinite(value := getattr(vector, axis)):
            raise MessageError(f"{field}.{axis}", value, "a finite number")
