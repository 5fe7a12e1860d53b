# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Poses that name another frame than the chosen world are turned into it by tf, or refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
from lab_bags import Lab, pose_rows, pose_values
from test_lab_topics import assert_same_windows, original
from turning_sensor import add_tip, add_wrench, wrench_rows

from push_predictor.cli import main
from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.cdr import POSE_STAMPED, decode, encode
from push_predictor.recordings.fields.pose_rows import composed, inverted, normalised
from push_predictor.recordings.fields.transforms import Edge, TransformError, TransformTree
from push_predictor.recordings.fields.world_frame import poses_in_world
from push_predictor.recordings.fields.wrench_axes import in_sensor_axes
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import PoseStream, Recording
from push_predictor.recordings.topics import Topics, load_topics

VICON = normalised(np.array([[0.4, -0.2, 0.1, 0.1, 0.05, 0.6, 0.8]]))  # in the frame `table`
NAMES = Topics("/slider", "/tip", world="table")
ODOMETRY = "nav_msgs/msg/Odometry"


def seen_from(frame: np.ndarray, stream: PoseStream) -> np.ndarray:
    """The poses (n, 7) of a stream in a frame at (1 or n, 7)."""
    frames = np.broadcast_to(frame, (len(stream), 7))
    return composed(inverted(frames), pose_rows(stream))


def add_poses(lab: Lab, topic: str, stream: PoseStream, rows: np.ndarray, frame: str, kind: str = ODOMETRY) -> None:
    at = "pose.pose" if kind == ODOMETRY else "pose"
    lab.add(topic, kind, stream.stamp, (
        {**lab.header(stamp), "header.frame_id": frame, **pose_values(row, at, ("position", "orientation"))}
        for stamp, row in zip(stream.stamp.tolist(), rows, strict=True)
    ))  # fmt: skip


def two_frames() -> Lab:
    """A slider seen by a tracker at VICON, and a tip in the frame of the table; tf connects both."""
    lab = Lab(frame="table")
    add_poses(lab, "/slider", original().slider, seen_from(VICON, original().slider), "/vicon")
    lab.pose("/tip", "geometry_msgs/msg/PoseStamped", original().pusher, "pose")
    lab.transform("/tf_static", "table", "vicon", original().slider.stamp[:1], VICON)
    return lab


def assert_same_poses(found: Recording) -> None:
    for name in ("slider", "pusher"):
        one, other = getattr(found, name), getattr(original(), name)
        assert one.stamp.tolist() == other.stamp.tolist()
        for column in ("x", "y", "z", "heading"):
            np.testing.assert_allclose(getattr(one, column), getattr(other, column), rtol=0.0, atol=1e-9)


# --- pure functions ---------------------------------------------------------------------------------------------------


def test_messages_in_the_world_or_without_a_frame_stay_as_they_are() -> None:
    stamp = np.array([5, 6], np.int64)
    rows = np.zeros((2, 7))
    messages = [*encode(stamp, rows, POSE_STAMPED, "table"), *encode(stamp, rows, POSE_STAMPED, ""), b"damaged"]
    found, known = poses_in_world(messages, "table", None)
    assert found == messages and known.all()


def test_a_pose_is_turned_by_the_transform_at_its_stamp() -> None:
    """A cart moves at 1 m/s along x; its axes are a quarter of a turn from the table's."""
    stamp = np.array([0, 100], np.int64) * 1_000_000
    half = np.sqrt(0.5)
    cart = np.array([[x, 0.0, 0.0, 0.0, 0.0, half, half] for x in (0.0, 0.1)])
    tree = TransformTree({"cart": Edge("table", stamp, cart, static=False)})
    seen = encode(np.array([25_000_000, 200_000_000]), np.tile([0.5, 0, 0, 0, 0, 0, 1.0], (2, 1)), POSE_STAMPED, "cart")
    found, known = poses_in_world(seen, "table", tree)
    assert known.tolist() == [True, False]
    columns = decode(found[:1], POSE_STAMPED)
    assert columns.frames == {"table"} and columns.stamp.tolist() == [25_000_000]
    np.testing.assert_allclose(columns.values, [[0.025, 0.5, 0.0, 0.0, 0.0, half, half]], atol=1e-12)
    with pytest.raises(TransformError, match="no frame 'cart'"):
        poses_in_world(seen, "table", TransformTree({}))


# --- recordings -------------------------------------------------------------------------------------------------------


def test_poses_in_two_frames_give_the_same_windows(tmp_path: Path) -> None:
    path = two_frames().mcap(tmp_path / "lab", original().rig)
    found = read_recording(path, topics=NAMES)
    assert_same_poses(found)
    assert found.notes == ()
    without = replace(original(), wrench=None)
    assert_same_windows(read_recording(path, topics=NAMES), without)


def test_a_frame_of_tf_and_poses_of_another_frame_meet_in_the_world(tmp_path: Path) -> None:
    lab = two_frames()
    in_vicon = seen_from(VICON, original().pusher)
    lab.transform("/tf", "vicon", "tool0", original().pusher.stamp, in_vicon)
    assert_same_poses(read_recording(lab.mcap(tmp_path / "lab"), topics=replace(NAMES, pusher="/tf:tool0")))


def test_without_the_option_different_frames_are_noted(tmp_path: Path) -> None:
    found = read_recording(two_frames().mcap(tmp_path / "lab"), topics=replace(NAMES, world=""))
    assert any("different frames, 'vicon' and 'table'; --world-frame turns both" in note for note in found.notes)
    assert not np.allclose(found.slider.x, original().slider.x)


def test_a_moving_frame_has_no_pose_in_its_dropout(tmp_path: Path) -> None:
    lab, slider = Lab(frame="table"), original().slider
    angle = 1e-9 * (slider.stamp - slider.stamp[0])
    none = np.zeros(len(slider))
    cart = np.column_stack([angle, none, none, none, none, np.sin(angle / 2), np.cos(angle / 2)])
    kept = np.abs(np.arange(len(slider)) - 400) > 30
    lab.transform("/tf", "table", "cart", slider.stamp[kept], cart[kept])
    add_poses(lab, "/slider", slider, seen_from(cart, slider), "cart", "geometry_msgs/msg/PoseStamped")
    lab.pose("/tip", "geometry_msgs/msg/PoseStamped", original().pusher, "pose")
    found = read_recording(lab.mcap(tmp_path / "lab"), topics=NAMES)
    assert "/slider: 61 samples outside the time, or in a dropout, of a transform; discarded" in found.notes
    assert found.slider.stamp.tolist() == slider.stamp[kept].tolist()
    np.testing.assert_allclose(found.slider.x, slider.x[kept], atol=1e-9)


def test_a_tip_without_orientation_is_turned_and_stays_without(tmp_path: Path) -> None:
    lab, pusher = two_frames(), original().pusher
    lab.messages = [message for message in lab.messages if message[1] != "/tip"]
    rows = seen_from(VICON, pusher)
    rows[:, 3:] = 0.0
    lab.frame = "vicon"
    add_tip(lab, "/tip", pusher.stamp, rows)
    found = read_recording(lab.mcap(tmp_path / "lab"), topics=NAMES)
    np.testing.assert_allclose(found.pusher.x, pusher.x, atol=1e-9)
    assert any(f"/tip: {len(pusher)} samples have no orientation" in note for note in found.notes)


def test_a_wrench_is_turned_into_the_chosen_world(tmp_path: Path) -> None:
    lab, wrench = two_frames(), original().wrench
    assert wrench is not None
    in_vicon = in_sensor_axes(wrench_rows(wrench), np.repeat(VICON, len(wrench), axis=0))
    add_wrench(lab, "/ft", wrench.stamp, in_vicon, "vicon")
    path = lab.mcap(tmp_path / "lab")
    found = read_recording(path, topics=replace(NAMES, wrench="/ft", wrench_frame="vicon")).wrench
    assert found is not None
    for name in ("fx", "fy"):
        np.testing.assert_allclose(getattr(found, name), getattr(wrench, name), rtol=0.0, atol=1e-9)
    noted = read_recording(path, topics=replace(NAMES, wrench="/ft")).notes
    assert any("/ft: frame_id 'vicon' is treated as 'table'; --wrench-frame vicon turns" in note for note in noted)


@pytest.mark.parametrize(
    ("world", "message"),
    [
        ("desk", r"slider_topic '/slider' .*: no frame 'desk'; .*world_frame 'desk' \(option --w"),
        (
            "moon",
            r"slider_topic '/slider' .*: no transforms connect frame 'vicon' .* with 'moon'; .*world_frame 'moon'",
        ),
    ],
)
def test_a_world_that_tf_does_not_reach_is_refused(tmp_path: Path, world: str, message: str) -> None:
    lab = two_frames()
    lab.transform("/tf_static", "earth", "moon", original().slider.stamp[:1], VICON)
    with pytest.raises(RecordingError, match=message):
        read_recording(lab.mcap(tmp_path / "lab"), topics=replace(NAMES, world=world))


def test_without_tf_another_frame_is_refused(tmp_path: Path) -> None:
    lab = two_frames()
    del lab.kinds["/tf_static"]
    lab.messages = [message for message in lab.messages if message[1] != "/tf_static"]
    path = lab.mcap(tmp_path / "lab")
    expected = (
        r"slider_topic '/slider' \(option --slider-topic\): the poses are in frame 'vicon', and the bag has no /tf"
    )
    with pytest.raises(RecordingError, match=expected):
        read_recording(path, topics=NAMES)


def test_the_world_is_an_option_and_is_saved(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(two_frames().mcap(tmp_path / "lab", original().rig))
    names = ["--slider-topic", "/slider", "--pusher-topic", "/tip"]
    assert main(["info", path, *names, "--world-frame", "table", "--save-topics"]) == 0
    assert load_topics(tmp_path / "lab") == NAMES
    assert "world_frame: table" in (tmp_path / "lab.recording.yaml").read_text()
    assert main(["check", path]) == 0
    assert main(["info", path, "--world-frame", "desk"]) == 1
    assert "world_frame 'desk' (option --world-frame)" in capsys.readouterr().err
