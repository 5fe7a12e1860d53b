# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Poses that name another frame than the chosen world are turned into it by tf, or refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
from decoding import decoded, decoder_of, in_portions, put
from lab_bags import Lab, pose_rows
from test_lab_topics import assert_same_windows, original
from turning_sensor import add_tip, add_wrench, in_sensor_axes, wrench_rows

from push_predictor.errors import RecordingError
from push_predictor.recordings.decoder.rules import NO_TRANSFORM
from push_predictor.recordings.fields.pose_rows import composed, inverted, normalised
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import PoseStream, Recording
from push_predictor.recordings.topics import Topics

VICON = normalised(np.array([[0.4, -0.2, 0.1, 0.1, 0.05, 0.6, 0.8]]))  # in the frame `table`
NAMES = Topics("/slider", "/tip", world="table")
ODOMETRY, POSE = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"


def seen_from(frame: np.ndarray, stream: PoseStream) -> np.ndarray:
    """The poses (n, 7) of a stream in a frame at (1 or n, 7)."""
    frames = np.broadcast_to(frame, (len(stream), 7))
    return composed(inverted(frames), pose_rows(stream))


def two_frames() -> Lab:
    """A slider seen by a tracker at VICON, and a tip in the frame of the table; tf connects both."""
    lab = Lab(frame="table")
    seen = seen_from(VICON, original().slider)
    lab.poses("/slider", ODOMETRY, original().slider.stamp, seen, "pose.pose", **{"header.frame_id": "/vicon"})
    lab.pose("/tip", "geometry_msgs/msg/PoseStamped", original().pusher, "pose")
    lab.transform("/tf_static", "table", "vicon", original().slider.stamp[:1], VICON)
    return lab


def assert_same_poses(found: Recording) -> None:
    for name in ("slider", "pusher"):
        one, other = getattr(found, name), getattr(original(), name)
        assert one.stamp.tolist() == other.stamp.tolist()
        for column in ("x", "y", "z", "heading"):
            np.testing.assert_allclose(getattr(one, column), getattr(other, column), rtol=0.0, atol=1e-9)


# --- the decoder -----------------------------------------------------------------------------------------------------

HALF = np.sqrt(0.5)
MS = 1_000_000


def seen_from_cart(stamps: np.ndarray, cart: np.ndarray, frame: str = "cart") -> Lab:
    """A slider at rest in a frame; a cart moves at 1 m/s along x, its axes a quarter of a turn from the table's."""
    lab, slider = Lab(frame="table"), np.tile([0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(stamps), 1))
    lab.frame = frame
    add_tip(lab, "/slider", stamps, slider)
    rows = [[1e-9 * at, 0.0, 0.0, 0.0, 0.0, HALF, HALF] for at in cart]
    lab.transform("/tf", "table", "cart", cart, rows)
    return lab


@pytest.mark.parametrize("frame", ["table", "/table", ""])
def test_poses_in_the_world_or_without_a_frame_stay_as_they_are(frame: str) -> None:
    lab = seen_from_cart(np.array([5, 6]), np.array([0, 100 * MS]), frame)
    decoder = decoder_of(lab, NAMES)
    put(decoder, lab, lab.in_order())
    assert decoder.take().slider.x.tolist() == [0.5, 0.5]


def test_a_pose_is_turned_by_the_transform_at_its_stamp() -> None:
    lab = seen_from_cart(np.array([25 * MS, 200 * MS]), np.array([0, 100 * MS]))
    decoder = decoder_of(lab, NAMES)
    found = decoded(decoder, lab, [lab.in_order()]).slider
    assert found.stamp.tolist() == [25 * MS] and decoder.of("slider").rejected == {NO_TRANSFORM: 1}
    np.testing.assert_allclose([found.x, found.y, found.heading], [[0.025], [0.5], [0.5 * np.pi]], atol=1e-12)


def test_a_pose_waits_for_its_transform_and_later_ones_wait_behind_it() -> None:
    stamps = np.arange(0, 1000 * MS, 10 * MS)
    lab = seen_from_cart(stamps, np.arange(0, 1001 * MS, 20 * MS))
    add_tip(other := Lab(frame="table"), "/slider", stamps[-1:] + MS, np.array([[0.0] * 6 + [1.0]]))
    decoder = decoder_of(lab, NAMES)
    poses, transforms = ([m for m in lab.in_order() if (m[1] == "/tf") is tf] for tf in (False, True))
    put(decoder, lab, [*poses, *other.messages], live=True)
    assert len(decoder.take().slider) == 0 and len(decoder) == len(stamps) + 1
    put(decoder, lab, transforms[:26], live=True)
    assert decoder.take().slider.stamp.tolist() == stamps[:51].tolist()
    put(decoder, lab, transforms[26:], live=True)
    assert decoder.take().slider.stamp.tolist() == [*stamps[51:].tolist(), int(stamps[-1]) + MS]
    assert not decoder.of("slider").rejected and len(decoder) == 0


def test_a_pose_without_a_transform_within_two_seconds_is_rejected() -> None:
    stamps = np.arange(0, 6000 * MS, 20 * MS)
    lab = seen_from_cart(stamps, np.arange(0, 2001 * MS, 20 * MS))
    decoder = decoder_of(lab, NAMES)
    for each in in_portions(lab.in_order(), 50):
        put(decoder, lab, each, live=True)
        decoder.take()
    late = int(np.sum((stamps > 2000 * MS) & (stamps < stamps[-1] - 2000 * MS)))
    assert decoder.of("slider").rejected == {NO_TRANSFORM: late} and len(decoder) == 100 + 1
    decoder.take(last=True)
    assert decoder.of("slider").rejected == {NO_TRANSFORM: late + 101} and len(decoder) == 0


# --- recordings -------------------------------------------------------------------------------------------------------


def test_poses_in_two_frames_give_the_same_windows(tmp_path: Path) -> None:
    path = two_frames().mcap(tmp_path / "lab", original().rig)
    found = read_recording(path, topics=NAMES)
    assert_same_poses(found)
    assert found.notes == ()
    without = replace(original(), wrench=None)
    assert_same_windows(read_recording(path, topics=NAMES), without)


def test_without_the_option_different_frames_are_noted(tmp_path: Path) -> None:
    found = read_recording(two_frames().mcap(tmp_path / "lab"), topics=replace(NAMES, world=""))
    assert any("different frames, 'vicon' and 'table'; --world-frame turns both" in note for note in found.notes)
    assert not np.allclose(found.slider.x, original().slider.x)


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
        r"slider_topic '/slider' \(option --slider-topic\): the poses are in frame 'vicon', and there is no /tf from"
    )
    with pytest.raises(RecordingError, match=expected):
        read_recording(path, topics=NAMES)


def test_poses_in_another_frame_go_on_after_a_replay_began_again() -> None:
    """The newest poses wait for tf at the end of each round; they must not hold back the next round."""
    begin, rounds = 100 * 10**9, []
    stamp = begin + np.arange(0, 4 * 10**9, 4 * 10**6)
    lab = Lab()
    rows = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(stamp), 1))
    for topic in ("/slider/pose", "/pusher/pose"):
        given = {"header.frame_id": "cam", "pose.orientation.w": 1.0}
        poses = ({**lab.header(time, "header"), **given} for time in stamp.tolist())
        lab.add(topic, "geometry_msgs/msg/PoseStamped", stamp, poses)
    lab.transform("/tf", "base", "cam", stamp[::5], rows[::5])
    decoder = decoder_of(lab, Topics(world="base"))
    for _ in range(3):
        count = 0
        for portion in in_portions(lab.in_order(), 200):
            put(decoder, lab, portion, live=True)
            count += len(decoder.take().slider)
        rounds.append(count)
    assert min(rounds) > 0.99 * len(stamp)
    assert decoder.of("slider").rejected.total() + sum(rounds) + len(decoder.poses["slider"]) == 3 * len(stamp)
