# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Import of ROS 1 bags of known rigs, distinguished by their topics."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from push_predictor.errors import ImportSourceError
from push_predictor.recordings.importers.cleaning import Samples, in_order, twist
from push_predictor.recordings.importers.mcube.pushes import assemble
from push_predictor.recordings.importers.mcube.rig import block_of
from push_predictor.recordings.importers.mlab.bag import TOPICS as MLAB
from push_predictor.recordings.importers.mlab.bag import read_mlab_bag
from push_predictor.recordings.importers.report import ImportReport, Notes
from push_predictor.recordings.importers.rosbag1_file import (
    bag_messages,
    bag_topics,
    header_lead,
    header_time,
    samples_of,
)
from push_predictor.recordings.importers.staging import Staging, safe_name
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording

TRANSFORM = "geometry_msgs/TransformStamped"
FORCE = "/netft_data"
TIP = "/tip_pose"
ACCEPTED = (
    f"mcube (/vicon/NAME/NAME {TRANSFORM}, {FORCE} geometry_msgs/WrenchStamped, {TIP} geometry_msgs/PoseStamped) or "
    f"mlab (/Mocap Mocap/mocap_frame, {FORCE} geometry_msgs/WrenchStamped, /robot_CartesianLog "
    "robot_comm/robot_CartesianLog)"
)


def import_rosbag1(sources: Sequence[Path], staging: Staging, rig: Rig | None = None) -> ImportReport:
    """One recording for each bag in files and folders (recursive). Raises ImportSourceError.

    A bag of the mlab profile gets no rig, because its object is not recorded.
    """
    notes = Notes()
    for path in staging.in_turn(_bags(sources)):
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


def _transform(message: object) -> tuple[float, float, float, float]:
    pose = message.transform  # type: ignore[attr-defined]  # typed at run time
    return pose.translation.x, pose.translation.y, pose.rotation.z, pose.rotation.w


def _wrench(message: object) -> tuple[float, float, float]:
    wrench = message.wrench  # type: ignore[attr-defined]  # typed at run time
    return wrench.force.x, wrench.force.y, wrench.torque.z


def _position(message: object) -> tuple[float, float, float]:
    position = message.pose.position  # type: ignore[attr-defined]  # typed at run time
    return position.x, position.y, position.z


def _bags(sources: Sequence[Path]) -> list[Path]:
    found = []
    for source in sources:
        inside = sorted(source.rglob("*.bag")) if source.is_dir() else [source]
        if not inside:
            raise ImportSourceError(f"{source}: contains no .bag file")
        found += inside
    return found
