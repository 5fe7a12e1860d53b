# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Import of ROS 1 bags."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lab_bags import assign, zeros

from push_predictor.errors import ImportSourceError
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.read import read_recording

MOCAP = """Header header
int64 number
geometry_msgs/Pose[] body_poses
Mocap/marker_set uid_markers
================================================================================
MSG: Mocap/marker_set
geometry_msgs/Point[] markers
"""
ROBOT = "string date\nstring time\nfloat64 timeStamp\n" + "".join(
    f"float64 {name}\n" for name in ("x", "y", "z", "q0", "qx", "qy", "qz")
)


def _write_bag(path: Path, topics: dict[str, tuple[str, str | None, list[dict[str, object]]]]) -> Path:
    """A ROS 1 bag: topic -> (type, definition or None for a standard type, messages with 't', the bag's time in s).

    A message's values are given by the dotted path of the field.
    """
    rosbag1 = pytest.importorskip("rosbags.rosbag1")
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with rosbag1.Writer(path) as writer:
        for topic, (kind, definition, messages) in topics.items():
            name = kind.replace("Mocap", "mocap")
            if definition:
                store.register(get_types_from_msg(definition.replace("Mocap/", "mocap/"), name))
            recorded, digest = store.generate_msgdef(name, ros_version=1)
            recorded = recorded.replace("mocap/", "Mocap/")
            connection = writer.add_connection(topic, kind, typestore=store, msgdef=recorded, md5sum=digest)
            for values in messages:
                data = store.serialize_ros1(_filled(store, name, values), name)
                writer.write(connection, round(1e9 * float(str(values["t"]))), data)
    return path


def _filled(store: Any, kind: str, values: dict[str, object]) -> Any:
    """A message of zeros with some values set; 'body' (x, y, qx, qy, qz, qw) is a pose in a list."""
    message = zeros(store, kind)
    for place, value in values.items():
        if place == "body":
            pose = zeros(store, "geometry_msgs/msg/Pose")
            paths = ("position.x", "position.y", *(f"orientation.{axis}" for axis in "xyzw"))
            for path, number in zip(paths, value, strict=True):  # type: ignore[call-overload]
                assign(pose, path, number)
            message.body_poses.append(pose)
        elif place != "t":
            assign(message, place, value)
    return message


def _stamp(seconds: float, lead: float = 0.0) -> dict[str, object]:
    whole = int(seconds + lead)
    return {"t": seconds, "header.stamp.sec": whole, "header.stamp.nanosec": round((seconds + lead - whole) * 1e9)}


def test_mcube_bag_has_the_frames_of_the_text_files(tmp_path: Path) -> None:
    start, half = 1_439_494_853.0, np.sqrt(0.5)
    body, force, tip = [], [], []
    for k in range(300):
        y, at = 0.05 * max(0.0, 0.01 * k - 1.0), start + 0.01 * k
        place = {"transform.translation.x": -0.0358, "transform.translation.y": -0.2 + y}
        body.append(_stamp(at) | place | {"transform.rotation.z": half, "transform.rotation.w": half})
        force.append(_stamp(at) | {"wrench.force.x": -2.0 * (y > 0), "wrench.force.y": 0.3})
        tip.append(_stamp(at + 0.015) | {"pose.position.x": 0.36, "pose.position.y": -0.251745 + y})
    path = _write_bag(
        tmp_path / "run.bag",
        {
            "/vicon/Block/Block": ("geometry_msgs/msg/TransformStamped", None, body),
            "/netft_data": ("geometry_msgs/msg/WrenchStamped", None, force),
            "/tip_pose": ("geometry_msgs/msg/PoseStamped", None, tip),
            "/other": ("other_msgs/msg/Other", "float64 something\n", []),
        },
    )
    # The definition of a topic that is not imported cannot be read.
    path.write_bytes(path.read_bytes().replace(b"float64 something", b"float64 = nothing"))
    report = import_source("rosbag1", [path], tmp_path / "out")
    recording = read_recording(report.written[0])
    assert recording.rig is not None and recording.rig.shape == "steel_block" and recording.wrench is not None
    gap = recording.slider.y[200] - np.interp(recording.slider.stamp[200], recording.pusher.stamp, recording.pusher.y)
    assert not any("out of order" in each for each in report.repaired)
    assert gap == pytest.approx(0.0489 + 0.004745, abs=1e-5)
    assert recording.wrench.fy[250] == pytest.approx(-2.0) and recording.wrench.fx[250] == pytest.approx(0.0)


def test_mlab_bag_uses_bag_time_and_has_no_rig(tmp_path: Path) -> None:
    mocap, force, robot = [], [], []
    for k in range(240):
        at, x = 1_435_287_970.0 + 0.01667 * k, 500.0 + max(0.0, 0.1 * (k - 80))
        quaternion = (0.5, 0.5, 0.5, 0.5) if k != 7 else (0.0, 0.0, 0.0, 0.5)  # the body's y axis is up
        mocap.append(_stamp(at) | {"body": (x + 50.0, 3.0, *quaternion)})
        force.append(_stamp(at, 364.5) | {"wrench.force.x": -0.1 + 0.7 * (k > 80), "wrench.force.y": 0.02})
        robot.append({"t": at, "x": x, "y": 3.0, "z": 15.0, "q0": 1.0})
    path = _write_bag(
        tmp_path / "robot.bag",
        {
            "/Mocap": ("Mocap/msg/mocap_frame", MOCAP, mocap),
            "/netft_data": ("geometry_msgs/msg/WrenchStamped", None, force),
            "/robot_CartesianLog": ("robot_comm/msg/robot_CartesianLog", ROBOT, robot),
        },
    )
    report = import_source("rosbag1", [path], tmp_path / "out")
    recording = read_recording(report.written[0])
    assert recording.rig is None and recording.wrench is not None
    assert len(recording.slider) == 239
    np.testing.assert_allclose(recording.slider.heading, np.pi / 2, atol=1e-9)
    assert recording.wrench.stamp[0] == recording.slider.stamp[0] == recording.pusher.stamp[0]
    assert recording.wrench.fx[-1] == pytest.approx(-0.7) and recording.wrench.fy[-1] == pytest.approx(0.0)
    text = "\n".join([*report.dropped, *report.repaired, *report.assumed])
    for words in ("1 of 240 frames", "by 364.500 s", "without a push_rig record", "--rig"):
        assert words in text, words


def test_unknown_and_damaged_bags_are_rejected(tmp_path: Path) -> None:
    force = ("geometry_msgs/msg/WrenchStamped", None, [_stamp(1.0 + 0.1 * k) for k in range(20)])
    path = _write_bag(tmp_path / "other.bag", {"/netft_data": force})
    with pytest.raises(ImportSourceError, match=r"topics found: /netft_data .*accepted: mcube .*mlab"):
        import_source("rosbag1", [path], tmp_path / "out")
    whole = path.read_bytes()
    for data in (b"", whole[: len(whole) // 2], b"#ROSBAG V2.0\n" + whole[13:200], whole[::-1]):
        path.write_bytes(data)
        with pytest.raises(ImportSourceError, match=r"other\.bag"):
            import_source("rosbag1", [path], tmp_path / "out")
