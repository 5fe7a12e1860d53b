# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""ROS 1 bags of the MLab rig of June 2015: several consecutive pushes, bag time, lengths in mm.

The tracked body's axes are not the object's, and no calibration of that session exists: only the motion of the tracked
body is certain. So a recording gets a rig only if the caller gives one, in the tracked body's frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from push_predictor.geometry.frames import rotate, yaw_of_quaternion
from push_predictor.recordings.importers.cleaning import Samples, in_order, require_overlap, twist, without_repeats
from push_predictor.recordings.importers.report import Notes
from push_predictor.recordings.importers.rosbag1_file import Stamped, bag_time, header_lead, samples_of
from push_predictor.recordings.importers.staging import safe_name
from push_predictor.recordings.rig import HOW_TO_GIVE, Rig
from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream
from push_predictor.types import IntArray

TOPICS = ("/Mocap", "/netft_data", "/robot_CartesianLog")
MILLIMETRE = 1e-3
UNIT = 0.02  # largest error of a quaternion's norm; a larger one marks an untracked frame
PAUSE = 0.3  # s
MOVING = 0.001  # m/s
BODY = (
    "mlab bags: the slider's pose is that of the tracked body (origin at its markers, heading of its x axis). The pose "
    "of the outline in that body is not recorded, so only displacement and change of heading are certain"
)
FORCE = (
    "mlab bags: the force on the pusher in the world is R(tool yaw) diag(-1, 1) (F - zero). The axes were found from "
    "the pushes: the mean angle between force and reverse motion is 8 degrees or less in four bags, 22 in one. "
    "The zero is the mean of the pause with the smallest force"
)


def read_mlab_bag(path: Path, messages: Mapping[str, Sequence[Stamped]], rig: Rig | None, notes: Notes) -> Recording:
    """A recording from the messages of TOPICS. Raises ImportSourceError."""
    mocap, netft, robot = (messages[topic] for topic in TOPICS)
    body = in_order(samples_of(_tracked(path, mocap, notes), _body, bag_time), f"{path}: /Mocap", notes)
    force = in_order(samples_of(netft, _force, bag_time), f"{path}: /netft_data", notes)
    tool = in_order(samples_of(robot, _tool, bag_time), f"{path}: /robot_CartesianLog", notes)
    require_overlap({"slider": body.stamp, "pusher": tool.stamp, "force": force.stamp}, str(path))
    _report(path, netft, rig, notes)
    wrench = _on_pusher(force, tool, path, notes)
    tool = without_repeats(tool, f"{path}: /robot_CartesianLog", notes)
    x, y, z, yaw = tool.values.T
    bx, by, heading = body.values.T
    return Recording(
        name=safe_name(path.stem),
        rig=rig,
        slider=PoseStream(body.stamp, bx, by, np.zeros(len(bx)), np.unwrap(heading)),
        pusher=PoseStream(tool.stamp, x, y, z - np.min(z), np.unwrap(yaw)),
        wrench=wrench,
    )


def _report(path: Path, netft: Sequence[Stamped], rig: Rig | None, notes: Notes) -> None:
    least, median, most = header_lead(netft)
    notes.repaired.append(
        f"{path}: /netft_data header stamps lead the bag's clock by {median:.3f} s ({least:.3f} to {most:.3f}); "
        "bag time is used for all streams, because the robot's log has no other time"
    )
    notes.assume(BODY)
    notes.assume(FORCE)
    if rig is None:
        notes.assume(f"{path}: written without a push_rig record, so contact cannot be computed; {HOW_TO_GIVE}")


def _tracked(path: Path, mocap: Sequence[Stamped], notes: Notes) -> list[Stamped]:
    tracked = [item for item in mocap if len(item.message.body_poses) and _is_unit(item.message.body_poses[0])]
    if lost := len(mocap) - len(tracked):
        notes.dropped.append(f"{path}: /Mocap: {lost} of {len(mocap)} frames in which the body was not tracked")
    return tracked


def _is_unit(pose: Any) -> bool:
    q = pose.orientation
    return abs(float(np.sqrt(q.x**2 + q.y**2 + q.z**2 + q.w**2)) - 1.0) < UNIT


def _on_pusher(force: Samples, tool: Samples, path: Path, notes: Notes) -> WrenchStream:
    zero = force.values[_unloaded_rows(force, tool)].mean(axis=0)
    notes.repaired.append(f"{path}: force tared by {zero[0]:.3f}, {zero[1]:.3f} N (mean of a pause of {PAUSE} s)")
    fx, fy, tz = (force.values - zero).T
    yaw = np.interp(force.stamp, tool.stamp, np.unwrap(tool.values[:, 3]))
    world = rotate(np.column_stack([-fx, fy]), yaw)
    return WrenchStream(force.stamp, world[:, 0], world[:, 1], -tz)


def _unloaded_rows(force: Samples, tool: Samples) -> IntArray:
    """Rows of the force in the pause with the smallest component along the mean force of the moving tip."""
    time = (force.stamp - force.stamp[0]) * 1e-9
    when = (tool.stamp - force.stamp[0]) * 1e-9
    edges = np.arange(0.0, time[-1], PAUSE)
    ends = np.append(edges, edges[-1] + PAUSE)
    places = np.column_stack([np.interp(ends, when, axis) for axis in tool.values[:, :2].T])
    speed = np.hypot(*np.diff(places, axis=0).T) / PAUSE
    slot = np.minimum((time / PAUSE).astype(np.int64), len(speed) - 1)
    moving = speed > MOVING
    if np.all(moving) or not np.any(moving):
        return np.arange(min(len(time), 10))
    pressing = force.values[moving[slot], :2].mean(axis=0) - force.values[~moving[slot], :2].mean(axis=0)
    pauses = [k for k in np.flatnonzero(~moving) if np.any(slot == k)]
    along = [float(np.mean(force.values[slot == k, :2] @ pressing)) for k in pauses]
    return np.flatnonzero(slot == pauses[int(np.argmin(along))])


def _body(message: Any) -> tuple[float, float, float]:
    pose = message.body_poses[0]
    q = pose.orientation
    return pose.position.x * MILLIMETRE, pose.position.y * MILLIMETRE, float(yaw_of_quaternion(q.x, q.y, q.z, q.w))


def _force(message: Any) -> tuple[float, float, float]:
    return message.wrench.force.x, message.wrench.force.y, message.wrench.torque.z


def _tool(message: Any) -> tuple[float, float, float, float]:
    place = (message.x * MILLIMETRE, message.y * MILLIMETRE, message.z * MILLIMETRE)
    return *place, float(twist(message.qz, message.q0))
