# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A wrench along the axes of a sensor that turns gives the recording made along the world's axes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
from lab_bags import Lab
from test_lab_topics import assert_same_windows, original, tf_lab, wrench
from turning_sensor import (
    add_tip,
    add_wrench,
    measured_at_mount,
    measured_at_tip,
    sensor_tf,
    tip_rows,
    wrench_rows,
)

from push_predictor.errors import RecordingError
from push_predictor.recordings.fields.pose_rows import about_points, in_world_axes, normalised, poses_at
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.topics import Topics

POSE = "geometry_msgs/msg/PoseStamped"
NAMES = Topics("/slider", "/tip", "/ft", wrench_frame="tip")
QUARTER = np.array([[0.3, 0.1, 0.0, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]])  # about z
DOWN = np.array([[0.0, 0.0, 0.4, 1.0, 0.0, 0.0, 0.0]])  # half a turn about x: a tool that points down
MILLISECOND = 1_000_000


def lab_of_tip(values: np.ndarray | None = None, frame: str = "ft_link", poses: str = "world") -> Lab:
    """A sensor with the axes of a tip, whose quaternions do not have length 1."""
    lab, pusher = Lab(frame=poses), original().pusher
    lab.pose("/slider", POSE, original().slider, "pose")
    add_tip(lab, "/tip", pusher.stamp, tip_rows(pusher, pusher.stamp) * [1, 1, 1, 1.1, 1.1, 1.1, 1.1])
    add_wrench(lab, "/ft", wrench().stamp, measured_at_tip(wrench(), pusher) if values is None else values, frame)
    return lab


def assert_same_wrench(found: Recording) -> None:
    assert found.wrench is not None
    assert found.wrench.stamp.tolist() == wrench().stamp.tolist()
    for name in ("fx", "fy", "torque"):
        np.testing.assert_allclose(getattr(found.wrench, name), getattr(wrench(), name), rtol=0.0, atol=1e-9)


# --- pure functions ---------------------------------------------------------------------------------------------------


def test_a_known_wrench_is_turned_by_the_sensors_pose() -> None:
    measured = np.array([[1.0, 2.0, 3.0, 0.1, 0.2, 0.3]])
    np.testing.assert_allclose(in_world_axes(measured, QUARTER), [[-2.0, 1.0, 3.0, -0.2, 0.1, 0.3]], atol=1e-15)
    np.testing.assert_allclose(in_world_axes(measured, DOWN), [[1.0, -2.0, -3.0, 0.1, -0.2, -0.3]], atol=1e-15)


def test_a_torque_about_another_point_has_the_lever_of_the_force() -> None:
    measured = np.array([[0.0, 2.0, 0.0, 0.0, 0.0, 0.5]])
    moved = about_points(measured, np.array([[0.4, 0.0, 0.0]]), np.array([[0.1, 0.0, 0.0]]))
    np.testing.assert_allclose(moved, [[0.0, 2.0, 0.0, 0.0, 0.0, 0.5 + 0.3 * 2.0]])


def test_poses_are_interpolated_at_stamps_in_any_order_but_not_across_a_dropout() -> None:
    known = MILLISECOND * np.array([30, 0, 10, 20, 500])
    angle = known * 1e-9
    poses = np.column_stack([angle, np.zeros((5, 4)), np.sin(angle / 2), np.cos(angle / 2)])
    found = poses_at(MILLISECOND * np.array([-1, 0, 15, 30, 31, 499, 500, 501]), known, poses)
    assert np.isnan(found).all(axis=1).tolist() == [True, False, False, False, True, True, False, True]
    np.testing.assert_allclose(found[2], [0.015, 0, 0, 0, 0, np.sin(0.0075), np.cos(0.0075)], atol=1e-12)
    assert found[6, 0] == pytest.approx(0.5)


def test_one_pose_is_known_at_its_own_stamp_only_and_none_nowhere() -> None:
    found = poses_at(np.array([4, 5, 6]), np.array([5]), QUARTER)
    assert np.isnan(found).all(axis=1).tolist() == [True, False, True]
    assert np.isnan(poses_at(np.array([5]), np.array([], np.int64), np.zeros((0, 7)))).all()


# --- recordings -------------------------------------------------------------------------------------------------------


def test_a_sensor_that_turns_with_the_tip_gives_the_same_windows(tmp_path: Path) -> None:
    found = read_recording(lab_of_tip().mcap(tmp_path / "lab", original().rig), topics=NAMES)
    assert_same_wrench(found)
    assert_same_windows(found)
    assert "the axes of the wrench are turned with the tip (/tip)" in found.notes


def test_a_sensor_in_a_frame_of_tf_gives_the_same_windows(tmp_path: Path) -> None:
    lab = lab_of_tip(measured_at_mount(wrench(), original().pusher))
    sensor_tf(lab, original().pusher, normalised(np.array([[-0.5, 0.3, 0.02, 0.1, 0.0, 0.6, 0.8]])))
    path = lab.mcap(tmp_path / "lab", original().rig)
    for topics in (replace(NAMES, wrench_frame="ft"), replace(NAMES, pusher="/tf:tool0", wrench_frame="/tf:ft")):
        found = read_recording(path, topics=topics)
        assert_same_wrench(found)
        assert_same_windows(found)
        assert any("from 'ft' to 'world' by tf" in note for note in found.notes)


def test_a_frame_is_turned_into_the_frame_of_the_poses(tmp_path: Path) -> None:
    """The poses name a frame below the root of tf, with other axes than it."""
    lab = lab_of_tip(measured_at_mount(wrench(), original().pusher), poses="bench")
    base = normalised(np.array([[-0.5, 0.3, 0.02, 0.1, 0.0, 0.6, 0.8]]))
    sensor_tf(lab, original().pusher, base, "bench")
    lab.transform("/tf_static", "earth", "bench", original().pusher.stamp[:1], QUARTER)
    found = read_recording(lab.mcap(tmp_path / "lab", original().rig), topics=replace(NAMES, wrench_frame="ft"))
    assert_same_wrench(found)


def test_wrenches_without_a_pose_of_the_tip_are_discarded_with_a_note(tmp_path: Path) -> None:
    lab = lab_of_tip()
    kept = [(at, topic, data) for at, topic, data in lab.messages if topic != "/tip"]
    poses = [message for message in lab.messages if message[1] == "/tip"]
    lab.messages = [*kept, *poses[:100], *poses[140:]]  # of 10 ms: the force at 5 ms + 20 ms k from 990 to 1400 ms
    found = read_recording(lab.mcap(tmp_path / "lab"), topics=NAMES)
    assert found.wrench is not None and len(found.wrench) == len(wrench()) - 20
    assert "/ft: 20 samples outside the time, or in a dropout, of their frame; discarded" in found.notes


def test_a_wrench_that_is_turned_needs_all_its_numbers(tmp_path: Path) -> None:
    values = measured_at_tip(wrench(), original().pusher)
    values[7, 2] = np.nan
    path = lab_of_tip(values).mcap(tmp_path / "lab")
    found = read_recording(path, topics=NAMES)
    assert found.wrench is not None and len(found.wrench) == len(wrench()) - 1
    assert "/ft: 1 samples contain NaN or infinity; discarded" in found.notes
    planar = read_recording(path, topics=replace(NAMES, wrench_frame=""))
    assert planar.wrench is not None and len(planar.wrench) == len(wrench())


def test_a_wrench_in_another_frame_is_noted_until_its_axes_are_given(tmp_path: Path) -> None:
    lab = lab_of_tip()
    start = "/ft: frame_id 'ft_link' is treated as 'world'; "
    found = read_recording(lab.mcap(tmp_path / "lab"), topics=replace(NAMES, wrench_frame=""))
    assert any(note.startswith(start) and "--wrench-frame tip turns them with" in note for note in found.notes)
    found = read_recording(tmp_path / "lab", topics=replace(NAMES, wrench_frame="world"))
    assert found.notes == ()
    found = read_recording(lab_of_tip(frame="world").mcap(tmp_path / "same"), topics=replace(NAMES, wrench_frame=""))
    assert found.notes == ()


def test_the_note_names_tf_only_where_the_bag_has_it(tmp_path: Path) -> None:
    lab = lab_of_tip()
    notes = read_recording(lab.mcap(tmp_path / "lab"), topics=replace(NAMES, wrench_frame="")).notes
    assert "by tf" not in notes[0] and "the bag has no /tf" in notes[0]
    lab.transform("/tf", "world", "ft_link", wrench().stamp[:1], QUARTER)
    notes = read_recording(lab.mcap(tmp_path / "with_tf"), topics=replace(NAMES, wrench_frame="")).notes
    assert "--wrench-frame ft_link turns the axes by tf" in notes[0] and "no /tf" not in notes[0]


@pytest.mark.parametrize(
    ("tf", "frame", "message"),
    [
        (False, "ft", r"wrench_frame 'ft' \(option --wrench-frame\): the bag has no /tf; give tip or world"),
        (True, "fd", r"wrench_frame 'fd' .*: no frame 'fd'; the frames are .*block.*; tip and world are accepted"),
        (True, "moon", r"wrench_frame 'moon' .*: no transforms connect frame 'moon' \(root 'earth'\) with 'world'"),
    ],
)
def test_a_frame_that_tf_does_not_have_is_an_error(tmp_path: Path, tf: bool, frame: str, message: str) -> None:
    lab = lab_of_tip()
    if tf:
        lab = tf_lab()
        lab.pose("/slider", POSE, original().slider, "pose")
        lab.pose("/tip", POSE, original().pusher, "pose")
        add_wrench(lab, "/ft", wrench().stamp, wrench_rows(wrench()), "ft")
        lab.transform("/tf_static", "earth", "moon", wrench().stamp[:1], QUARTER)
    with pytest.raises(RecordingError, match=message):
        read_recording(lab.mcap(tmp_path / "lab"), topics=replace(NAMES, wrench_frame=frame))


def test_a_tip_without_orientation_turns_no_wrench(tmp_path: Path) -> None:
    lab, pusher = Lab(), original().pusher
    lab.pose("/slider", POSE, original().slider, "pose")
    poses = np.column_stack([pusher.x, pusher.y, pusher.z, np.zeros((len(pusher), 4))])
    add_tip(lab, "/tip", pusher.stamp, poses)
    add_wrench(lab, "/ft", wrench().stamp, wrench_rows(wrench()), "ft")
    with pytest.raises(
        RecordingError, match=r"wrench_frame 'tip' .*: the poses of /tip have no orientation; give world"
    ):
        read_recording(lab.mcap(tmp_path / "lab"), topics=NAMES)


def test_a_frame_named_tip_is_given_with_its_topic() -> None:
    named = Topics(wrench_frame="/tf:tip")
    assert (named.wrench_axes, named.wrench_tf_frame) == ("", "tip")
    assert (Topics().wrench_axes, Topics(wrench_frame="tip").wrench_axes) == ("world", "tip")
