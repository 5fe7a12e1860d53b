# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Import of ROS 1 bags of known rigs, distinguished by their topics: the MCube lab's, and the MLab's of June 2015.

MLab bags have several consecutive pushes, bag time, lengths in mm. The tracked body's axes are not the object's, and no
calibration of that session exists: only the motion of the tracked body is certain. So a recording gets a rig only if
the caller gives one, in the tracked body's frame.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from push_predictor.errors import ImportSourceError, RecordingError
from push_predictor.geometry.frames import rotate, yaw_of_quaternion
from push_predictor.recordings.bag.ros1_file import DAMAGE, lower_package, opened_ros1
from push_predictor.recordings.importers.cleaning import Samples, in_order, require_overlap, twist, without_repeats
from push_predictor.recordings.importers.mcube import assemble, block_of
from push_predictor.recordings.importers.staging import ImportReport, Notes, Staging, safe_name, sources_in
from push_predictor.recordings.rig import HOW_TO_GIVE, Rig
from push_predictor.recordings.streams import PoseStream, Recording, WrenchStream
from push_predictor.types import IntArray

TRANSFORM = "geometry_msgs/TransformStamped"
FORCE = "/netft_data"
TIP = "/tip_pose"
ACCEPTED = (
    f"mcube (/vicon/NAME/NAME {TRANSFORM}, {FORCE} geometry_msgs/WrenchStamped, {TIP} geometry_msgs/PoseStamped) or "
    f"mlab (/Mocap Mocap/mocap_frame, {FORCE} geometry_msgs/WrenchStamped, /robot_CartesianLog "
    "robot_comm/robot_CartesianLog)"
)
MLAB = ("/Mocap", FORCE, "/robot_CartesianLog")
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
        topics = bag_topics(path)
        if body := _vicon_body(topics):
            staging.recording(read_mcube_bag(path, body, rig, notes), pushes=1)
        elif all(topic in topics for topic in MLAB):
            staging.recording(read_mlab_bag(path, bag_messages(path, MLAB), rig, notes), pushes=0)
        else:
            found = ", ".join(f"{topic} {kind}" for topic, kind in sorted(topics.items())) or "none"
            raise ImportSourceError(f"{path}: topics found: {found}; accepted: {ACCEPTED}")
    return staging.report("rosbag1", notes)


def read_mcube_bag(path: Path, body_topic: str, rig: Rig | None, notes: Notes) -> Recording:
    """A bag of the MCube lab's rig. Raises ImportSourceError."""
    messages = bag_messages(path, (body_topic, FORCE, TIP))
    raw = {
        topic: in_order(samples_of(messages[topic], values, header_time), f"{path}: {topic}", notes)
        for topic, values in ((body_topic, _transform), (FORCE, _wrench), (TIP, _position))
    }
    leads = "; ".join(f"{topic} {-1e3 * header_lead(messages[topic])[1]:.1f} ms" for topic in raw)
    notes.assume(f"{path}: header stamps are used. The bag's clock is later by a median of {leads}")
    x, y, z, w = raw[body_topic].values.T
    body = Samples(raw[body_topic].stamp, np.column_stack([x, y, np.unwrap(twist(z, w))]))
    block = block_of(path, int(body.stamp[0]))
    return assemble(safe_name(path.stem), str(path), block, rig, body, raw[TIP], raw[FORCE], notes)


def _vicon_body(topics: dict[str, str]) -> str | None:
    """The topic of the single tracked body of an mcube bag, None for other bags."""
    bodies = [topic for topic, kind in topics.items() if topic.startswith("/vicon/") and kind == TRANSFORM]
    return bodies[0] if len(bodies) == 1 and FORCE in topics and TIP in topics else None


def _transform(message: Any) -> tuple[float, float, float, float]:
    pose = message.transform
    return pose.translation.x, pose.translation.y, pose.rotation.z, pose.rotation.w


def _wrench(message: Any) -> tuple[float, float, float]:
    wrench = message.wrench
    return wrench.force.x, wrench.force.y, wrench.torque.z


def _position(message: Any) -> tuple[float, float, float]:
    position = message.pose.position
    return position.x, position.y, position.z


class Stamped(NamedTuple):
    """A message and its bag time (ns)."""

    time: int
    message: Any


def bag_topics(path: Path) -> dict[str, str]:
    """Topics and their types, ROS 1 names. Raises ImportSourceError if the bag cannot be opened."""
    with _opened(path) as reader:
        return {c.topic: c.msgtype.replace("/msg/", "/") for c in reader.connections}


def bag_messages(path: Path, topics: Collection[str]) -> dict[str, list[Stamped]]:
    """All messages of the given topics in the bag's order. Raises ImportSourceError if one cannot be read."""
    from rosbags.rosbag1 import ReaderError
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    found: dict[str, list[Stamped]] = {topic: [] for topic in topics}
    with _opened(path) as reader:
        wanted = [c for c in reader.connections if c.topic in found]
        count = 0
        try:
            for c in wanted:
                if (name := lower_package(c.msgtype)) not in store.types:
                    store.register(get_types_from_msg(lower_package(c.msgdef.data), name))
            for c, time, data in reader.messages(connections=wanted):
                found[c.topic].append(Stamped(time, store.deserialize_ros1(data, lower_package(c.msgtype))))
                count += 1
        except (ReaderError, SerdeError, TypesysError, *DAMAGE) as error:
            reason = f"{type(error).__name__}: {error}"
            raise ImportSourceError(f"{path}: message {count} cannot be read ({reason})") from None
    return found


def samples_of(
    messages: Sequence[Stamped], values: Callable[[Any], Sequence[float]], stamp: Callable[[Stamped], int]
) -> Samples:
    """Stamps (n,) and values (n, k) of messages."""
    stamps = np.array([stamp(item) for item in messages], dtype=np.int64)
    rows = np.array([values(item.message) for item in messages], dtype=np.float64)
    return Samples(stamps, rows.reshape(len(stamps), -1))


def bag_time(item: Stamped) -> int:
    """The time at which the bag recorded the message, ns."""
    return item.time


def header_time(item: Stamped) -> int:
    """The header stamp, ns."""
    return int(item.message.header.stamp.sec) * 1_000_000_000 + int(item.message.header.stamp.nanosec)


def header_lead(messages: Sequence[Stamped]) -> tuple[float, float, float]:
    """Header stamp minus bag time, s: minimum, median, maximum."""
    lead = [(header_time(item) - item.time) * 1e-9 for item in messages]
    return float(np.min(lead)), float(np.median(lead)), float(np.max(lead))


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    try:
        with opened_ros1(path) as reader:
            yield reader
    except RecordingError as error:
        raise ImportSourceError(str(error)) from None


def read_mlab_bag(path: Path, messages: Mapping[str, Sequence[Stamped]], rig: Rig | None, notes: Notes) -> Recording:
    """A recording from the messages of MLAB. Raises ImportSourceError."""
    mocap, netft, robot = (messages[topic] for topic in MLAB)
    body = in_order(samples_of(_tracked(path, mocap, notes), _body, bag_time), f"{path}: /Mocap", notes)
    force = in_order(samples_of(netft, _wrench, bag_time), f"{path}: /netft_data", notes)
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
    notes.assume(ON_PUSHER)
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


def _tool(message: Any) -> tuple[float, float, float, float]:
    place = (message.x * MILLIMETRE, message.y * MILLIMETRE, message.z * MILLIMETRE)
    return *place, float(twist(message.qz, message.q0))
