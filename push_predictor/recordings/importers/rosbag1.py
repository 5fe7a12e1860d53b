# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Import of ROS 1 bags of known rigs, distinguished by their topics: the MCube lab's, and the MLab's of June 2015.

MLab bags have several consecutive pushes, bag time, lengths in mm. The tracked body's axes are not the object's, and no
calibration of that session exists: only the motion of the tracked body is certain. So a recording gets a rig only if
the caller gives one, in the tracked body's frame.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from push_predictor.errors import ImportSourceError, RecordingError
from push_predictor.geometry.frames import rotate, yaw_of_quaternion
from push_predictor.recordings.bag.message_types import short_name
from push_predictor.recordings.bag.ros1_file import Ros1File
from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.fields.columns import BlockReader
from push_predictor.recordings.fields.sources import definitions_of, header_stamps
from push_predictor.recordings.importers.cleaning import Samples, in_order, require_overlap, twist, without_repeats
from push_predictor.recordings.importers.mcube import assemble, block_of
from push_predictor.recordings.importers.staging import ImportReport, Notes, Staging, safe_name, sources_in
from push_predictor.recordings.rig import HOW_TO_GIVE, Rig
from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream
from push_predictor.types import Array, IntArray

TRANSFORM = "geometry_msgs/TransformStamped"
FORCE = "/netft_data"
TIP = "/tip_pose"
ACCEPTED = (
    f"mcube (/vicon/NAME/NAME {TRANSFORM}, {FORCE} geometry_msgs/WrenchStamped, {TIP} geometry_msgs/PoseStamped) or "
    f"mlab (/Mocap Mocap/mocap_frame, {FORCE} geometry_msgs/WrenchStamped, /robot_CartesianLog "
    "robot_comm/robot_CartesianLog)"
)
MLAB = ("/Mocap", FORCE, "/robot_CartesianLog")
TRANSLATION = ("transform.translation.x", "transform.translation.y", "transform.rotation.z", "transform.rotation.w")
WRENCH = ("wrench.force.x", "wrench.force.y", "wrench.torque.z")
POSITION = tuple(f"pose.position.{axis}" for axis in "xyz")
BODY_POSE = tuple(
    f"body_poses[0].{name}" for name in ("position.x", "position.y", *(f"orientation.{k}" for k in "xyzw"))
)
TOOL = ("x", "y", "z", "qz", "q0")
MILLIMETRE = 1e-3
UNIT = 0.02  # largest error of a quaternion's norm; a larger one marks an untracked frame
PAUSE = 0.3  # s
MOVING = 0.001  # m/s
BODY = (
    "mlab bags: the slider's pose is that of the tracked body (origin at its markers, heading of its x axis). The pose "
    "of the outline in that body is not recorded, so only displacement and change of heading are certain"
)
ON_PUSHER = (
    "mlab bags: the force on the pusher in the world is R(tool yaw) diag(-1, 1) (F - zero). The axes were found from "
    "the pushes: the mean angle between force and reverse motion is 8 degrees or less in four bags, 22 in one. "
    "The zero is the mean of the pause with the smallest force"
)


def import_rosbag1(sources: Sequence[Path], staging: Staging, rig: Rig | None = None) -> ImportReport:
    """One recording for each bag in files and folders (recursive). Raises ImportSourceError.

    A bag of the mlab profile gets no rig, because its object is not recorded.
    """
    notes = Notes()
    for path in staging.in_turn(sources_in(sources, "*.bag")):
        try:
            bag = Ros1File(path)
        except RecordingError as error:
            raise ImportSourceError(str(error)) from None
        if body := _vicon_body(bag.topics):
            staging.recording(_mcube_recording(bag, body, rig, notes), pushes=1)
        elif all(topic in bag.topics for topic in MLAB):
            staging.recording(_mlab_recording(bag, rig, notes), pushes=0)
        else:
            found = ", ".join(f"{topic} {short_name(kind)}" for topic, kind in sorted(bag.topics.items())) or "none"
            raise ImportSourceError(f"{path}: topics found: {found}; accepted: {ACCEPTED}")
    return staging.report("rosbag1", notes)


class _Logged(NamedTuple):
    """Numbers (n, k) in the messages of a topic that contain them; messages: how many it has in all.

    time, stamp (n,) ns: by the clock of the bag, and in the header, where there is one.
    """

    messages: int
    time: IntArray
    stamp: IntArray
    values: Array

    @property
    def lead(self) -> Array:
        """Header stamp minus bag time (n,), s."""
        return np.asarray((self.stamp - self.time) * NANOSECOND)


def _read(bag: Ros1File, fields: Mapping[str, Sequence[str]]) -> dict[str, _Logged]:
    """The numbers in fields of topics, {topic: paths}. Raises ImportSourceError if a message cannot be read."""
    readers = {
        topic: BlockReader(kind := bag.topics[topic], definitions_of(kind, bag.schemas), ("header", *paths))
        for topic, paths in fields.items()
    }
    opened = len(bag.notes)  # of them some on topics that are not read
    counts, parts = Counter[str](), defaultdict[str, list[tuple[IntArray, IntArray, IntArray, Array]]](list)
    for messages in bag.portions(fields):
        topic = messages.topic
        for block in readers[topic].blocks(messages):
            if block.layout.numbers.keys() >= set(fields[topic]):
                time = messages.times[block.rows]
                stamp = header_stamps(block, "header")[0] if "header.stamp.sec" in block.layout.numbers else time
                order = counts[topic] + block.rows
                parts[topic].append((order, time, stamp, block.numbers(fields[topic])))
        counts[topic] += len(messages)
    if len(bag.notes) > opened:
        raise ImportSourceError("; ".join(bag.notes))
    found = {}
    for topic, paths in fields.items():
        nothing = (*np.empty((3, 0), np.int64), np.empty((0, len(paths))))
        order, time, stamp, values = (np.concatenate(of) for of in zip(nothing, *parts[topic], strict=True))
        rows = np.argsort(order)
        found[topic] = _Logged(counts[topic], time[rows], stamp[rows], values[rows])
    return found


def _mcube_recording(bag: Ros1File, body_topic: str, rig: Rig | None, notes: Notes) -> Recording:
    """The recording in a bag of the MCube lab's rig. Raises ImportSourceError."""
    path, read = bag.path, _read(bag, {body_topic: TRANSLATION, FORCE: WRENCH, TIP: POSITION})
    raw = {topic: in_order(Samples(of.stamp, of.values), f"{path}: {topic}", notes) for topic, of in read.items()}
    leads = "; ".join(f"{topic} {-1e3 * np.median(of.lead):.1f} ms" for topic, of in read.items())
    notes.assume(f"{path}: header stamps are used. The bag's clock is later by a median of {leads}")
    x, y, z, w = raw[body_topic].values.T
    body = Samples(raw[body_topic].stamp, np.column_stack([x, y, np.unwrap(twist(z, w))]))
    block = block_of(path, int(body.stamp[0]))
    return assemble(safe_name(path.stem), str(path), block, rig, body, raw[TIP], raw[FORCE], notes)


def _vicon_body(topics: Mapping[str, str]) -> str | None:
    """The topic of the single tracked body of an mcube bag, None for other bags."""
    bodies = [topic for topic, kind in topics.items() if topic.startswith("/vicon/") and short_name(kind) == TRANSFORM]
    return bodies[0] if len(bodies) == 1 and FORCE in topics and TIP in topics else None


def _mlab_recording(bag: Ros1File, rig: Rig | None, notes: Notes) -> Recording:
    """The recording in a bag of MLAB. Raises ImportSourceError."""
    path, read = bag.path, _read(bag, dict(zip(MLAB, (BODY_POSE, WRENCH, TOOL), strict=True)))
    mocap, netft, robot = (read[topic] for topic in MLAB)
    body = in_order(_tracked(path, mocap, notes), f"{path}: /Mocap", notes)
    force = in_order(Samples(netft.time, netft.values), f"{path}: /netft_data", notes)
    tool = in_order(Samples(robot.time, robot.values), f"{path}: /robot_CartesianLog", notes)
    x, y, z, qz, q0 = tool.values.T
    tool = tool._replace(values=np.column_stack([MILLIMETRE * x, MILLIMETRE * y, MILLIMETRE * z, twist(qz, q0)]))
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


def _report(path: Path, netft: _Logged, rig: Rig | None, notes: Notes) -> None:
    lead = netft.lead
    notes.repaired.append(
        f"{path}: /netft_data header stamps lead the bag's clock by {np.median(lead):.3f} s ({lead.min():.3f} to "
        f"{lead.max():.3f}); bag time is used for all streams, because the robot's log has no other time"
    )
    notes.assume(BODY)
    notes.assume(ON_PUSHER)
    if rig is None:
        notes.assume(f"{path}: written without a push_rig record, so contact cannot be computed; {HOW_TO_GIVE}")


def _tracked(path: Path, mocap: _Logged, notes: Notes) -> Samples:
    """x, y (m) and heading of the tracked body."""
    tracked = np.abs(np.linalg.norm(mocap.values[:, 2:], axis=1) - 1.0) < UNIT
    if lost := mocap.messages - int(np.sum(tracked)):
        notes.dropped.append(f"{path}: /Mocap: {lost} of {mocap.messages} frames in which the body was not tracked")
    x, y, *quaternion = mocap.values[tracked].T
    heading = yaw_of_quaternion(*quaternion)
    return Samples(mocap.time[tracked], np.column_stack([MILLIMETRE * x, MILLIMETRE * y, heading]))


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
