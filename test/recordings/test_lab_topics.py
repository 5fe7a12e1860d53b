# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A laboratory's own topics, types and frames give the windows of the original recording."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rosbags")
from decoding import input_of
from lab_bags import Lab, pose_rows, robot_in_tf, short_recording

from push_predictor.cli import main
from push_predictor.errors import RecordingError, RequestError
from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.checks.check import checked_data
from push_predictor.recordings.decoder.decoder import StreamDecoder
from push_predictor.recordings.fields.pose_rows import composed, inverted, normalised
from push_predictor.recordings.fields.sources import POSE_TARGET, TF_TYPES, FieldReader, definitions_of
from push_predictor.recordings.fields.transforms import Edge, TransformTree, read_edges
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import Recording, WrenchStream
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.topics import Topics, load_topics, save_topics, topics_path
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import windows_to_table

VICON, UR = "/vicon/block/block", "/ur5/tool0_pose"
TRANSFORM = "geometry_msgs/msg/TransformStamped"
TIP = {
    "lab_msgs/msg/Tip": "string[] notes\nint8 state\nOdom odom\ngeometry_msgs/Wrench ft\nfloat32[] volts\n",
    "lab_msgs/msg/Odom": "std_msgs/Header header\nfloat64 age # s\nint8 K=3\ngeometry_msgs/PoseStamped pose\n",
}


@cache
def original() -> Recording:
    return short_recording(7.0)


def wrench() -> WrenchStream:
    found = original().wrench
    assert found is not None
    return found


def table(recording: Recording) -> PushTable:
    assert recording.rig is not None
    return windows_to_table(find_windows(recording, recording.rig))


@cache
def original_table(name: str) -> PushTable:
    return table(replace(original(), name=name))


def assert_same_windows(found: Recording, wanted: Recording | None = None) -> None:
    one, other = table(found), original_table(found.name) if wanted is None else table(replace(wanted, name=found.name))
    tolerance = {"rtol": 0.0, "atol": 1e-9}  # of rounding: a heading becomes a quaternion and a heading again
    assert len(one) == len(other) > 10 and one.push_id.tolist() == other.push_id.tolist()
    np.testing.assert_allclose(one.inputs, other.inputs, **tolerance)
    np.testing.assert_allclose(one.outcomes, other.outcomes, **tolerance)
    assert one.covariates.keys() == other.covariates.keys()


def copied(lab: Lab) -> Lab:
    """A laboratory to which a test may add; its messages are not made again."""
    other = copy(lab)
    other.kinds, other.messages = dict(lab.kinds), list(lab.messages)
    return other


def vicon_and_ur() -> Lab:
    return copied(made_vicon_and_ur())


@cache
def made_vicon_and_ur() -> Lab:
    lab = Lab(frame="vicon_world")
    lab.pose(VICON, TRANSFORM, original().slider, "transform")
    lab.pose(UR, TRANSFORM, original().pusher, "transform")
    lab.wrench("/netft", wrench(), "geometry_msgs/msg/WrenchStamped", "wrench")
    return lab


NAMES = Topics(VICON, UR, "/netft")
OTHERS = {"world": "map", "wrench_frame": "/tf:tip", "wrench_bias": "none", "stamp": "log", "up": "slider=-z"}
EVERY = Topics("/tf:a", covariates=("/b.c[1]",), **OTHERS)
AXES = "x, y, z, -x, -y or -z, of some streams"
ABSENT = r"no such topic; the bag contains .*/ur5/tool0_pose \(geometry_msgs/msg/TransformStamped\)"


# --- frames ----------------------------------------------------------------------------------------------------------


def tf_lab() -> Lab:
    return copied(made_tf_lab())


@cache
def made_tf_lab() -> Lab:
    return robot_in_tf(original())


def test_poses_are_given_in_the_chosen_frame(tmp_path: Path) -> None:
    path = tf_lab().mcap(tmp_path / "lab")
    found = read_recording(path, topics=Topics("/tf:block", "/tf:tip", world="base"))
    base = normalised(np.array([[-0.5, 0.3, 0.02, 0.0, 0.0, 0.6, 0.8]]))
    wanted = composed(inverted(np.repeat(base, len(found.slider), axis=0)), pose_rows(original().slider))
    np.testing.assert_allclose(np.column_stack([found.slider.x, found.slider.y]), wanted[:, :2], atol=1e-12)


@pytest.mark.parametrize(
    ("topics", "message"),
    [
        (Topics("/tf:blok", "/tf:tip"), r"slider_topic '/tf:blok' \(option --slider-topic\): no frame 'blok'; .*block"),
        (Topics("/tf:block", "/tf:camera"), r"pusher_topic '/tf:camera' .*never moves in 'world'"),
        (Topics("/tf:block", "/tf:tip", world="table"), r"lab: world_frame 'table' .*: no frame 'table'; .* arm, base"),
        (Topics("/tf:block", "/tf"), r"pusher_topic '/tf' .*TFMessage', give a frame, as in /tf:block"),
        (Topics("/tf:block", "/tf_static:island"), "no frame 'island'"),
    ],
)
def test_an_unknown_frame_is_an_error_that_names_the_frames(tmp_path: Path, topics: Topics, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        read_recording(tf_lab().mcap(tmp_path / "lab"), topics=topics)


@pytest.mark.parametrize(
    ("slider", "pusher", "named"),
    [
        ("/tf:block", "/tf:block", "/tf:block"),
        ("/tf:block", "tf:/block", "tf:/block"),
        ("/pusher/pose", "", "pusher/pose"),
    ],
)
def test_one_frame_or_topic_for_slider_and_tip_is_refused(tmp_path: Path, slider: str, pusher: str, named: str) -> None:
    words = rf"pusher_topic: '{named}' .*give another than slider_topic \(--slider-topic, --pusher-topic\)"
    with pytest.raises(RequestError, match=words):
        checked_data(tf_lab().mcap(tmp_path / "lab", original().rig), topics=Topics(slider, pusher))
    assert Topics("/tf:block", "/tf:tip").over(Topics("/tf:tip", "/tf:block")).pusher == "/tf:tip"


def test_frames_that_are_not_connected_or_have_two_parents_are_an_error(tmp_path: Path) -> None:
    lab = tf_lab()
    rows, stamp = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]] * 2), original().slider.stamp[:2]
    lab.transform("/tf", "moon", "lander", stamp, rows)
    with pytest.raises(RecordingError, match=r"no transforms connect frame 'lander' \(root 'moon'\) with 'world'"):
        read_recording(lab.mcap(tmp_path / "lab"), topics=Topics("/tf:block", "/tf:lander"))
    lab.transform("/tf", "earth", "lander", stamp, rows)
    with pytest.raises(RecordingError, match="frame 'lander' has the parents 'earth' and 'moon', one is accepted"):
        read_recording(lab.mcap(tmp_path / "lab"), topics=Topics("/tf:block", "/tf:lander"))


def test_a_frame_that_is_its_own_ancestor_is_an_error(tmp_path: Path) -> None:
    lab, rows = tf_lab(), np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    for parent, child in (("north", "south"), ("south", "north")):
        lab.transform("/tf", parent, child, original().slider.stamp[:1], rows)
    with pytest.raises(RecordingError, match="frame 'south' is its own ancestor: south in north in south"):
        read_recording(lab.mcap(tmp_path / "lab"), topics=Topics("/tf:block", "/tf:south"))


numbers = st.floats(-2.0, 2.0)
poses = st.lists(st.tuples(*[numbers] * 7).filter(lambda row: np.linalg.norm(row[3:]) > 0.1), min_size=1, max_size=6)


@given(poses, st.data())
def test_composition_through_a_random_tree_is_that_of_matrices(
    rows: list[tuple[float, ...]], data: st.DataObject
) -> None:
    parents = [data.draw(st.integers(0, child)) for child in range(len(rows))]
    matrices = [np.eye(4)]
    for parent, row in zip(parents, rows, strict=True):
        matrices.append(matrices[parent] @ matrix(normalised(np.array([row]))[0]))
    stamp = np.array([5], np.int64)
    edges = {
        f"f{child + 1}": Edge(f"f{parent}", stamp, normalised(np.array([row])), static=False)
        for child, (parent, row) in enumerate(zip(parents, rows, strict=True))
    }
    one = data.draw(st.integers(1, len(rows)))
    other = data.draw(st.integers(0, len(rows)).filter(lambda frame: frame != one))
    tree = TransformTree(edges)
    leader = next(iter(tree.moving(f"f{one}", f"f{other}")))
    found, rows_found, without = tree.poses(f"f{one}", f"f{other}", leader)
    assert found.tolist() == [5] and without == 0
    np.testing.assert_allclose(matrix(rows_found[0]), np.linalg.inv(matrices[other]) @ matrices[one], atol=1e-9)


def matrix(row: np.ndarray) -> np.ndarray:
    from push_predictor.geometry.frames import SpatialPose

    found = np.eye(4)
    found[:3, :3], found[:3, 3] = SpatialPose(row[:3], row[3:]).rotation, row[:3]
    return found


# --- errors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("topics", "message"),
    [
        (replace(NAMES, slider="/vicon/blok"), rf"slider_topic '/vicon/blok' \(option --slider-topic\): {ABSENT}"),
        (replace(NAMES, wrench="/ft"), rf"wrench_topic '/ft' \(option --wrench-topic\): {ABSENT}"),
        (replace(NAMES, covariates=("/heat",)), rf"covariate_topics '/heat' \(option --covariate-topic\): {ABSENT}"),
        (Topics(pusher=UR), r"no topic /slider/pose of geometry_msgs/msg/PoseStamped; .*; give --slider-topic$"),
        (replace(NAMES, pusher="/joints"), r"'/joints' .*JointState', which has no pose; take it .*in /tf:tool0"),
        (replace(NAMES, pusher="/netft"), r"WrenchStamped'; no field of it is a pose, geometry_msgs/msg/PoseStamped"),
        (replace(NAMES, wrench=UR), r"wrench_topic .*TransformStamped'; no field of it is a wrench"),
        (replace(NAMES, pusher=f"{UR}.pose"), r"has no pose in field 'pose', give one of .*: /ur5/tool0_pose.tr"),
        (replace(NAMES, slider=f"{VICON}:block"), r"TransformStamped'; only tf2_msgs/msg/TFMessage has frames"),
        (replace(NAMES, covariates=("/joints",)), r"JointState', give one of its fields: .*/joints.effort\[0\]"),
    ],
)  # fmt: skip
def test_an_error_names_option_value_and_what_the_bag_contains(tmp_path: Path, topics: Topics, message: str) -> None:
    lab = vicon_and_ur()
    lab.add("/joints", "sensor_msgs/msg/JointState", [5], iter([{"name": ["a"], "effort": np.array([1.0])}]))
    with pytest.raises(RecordingError, match=message):
        read_recording(lab.mcap(tmp_path / "lab"), topics=topics)


@given(st.binary(max_size=200))
def test_random_bytes_are_no_message_and_no_exception(data: bytes) -> None:
    for message in (data, b"\0\1\0\0" + data):
        input_of(StreamDecoder(Topics()).inputs()["slider"], "nav_msgs/msg/Odometry", message).take()
        read_edges([Messages.of("/tf", TF_TYPES[0], [0], [message])], static=False)


def test_a_type_that_contains_itself_has_no_readable_message() -> None:
    kind = "a_msgs/msg/Loop"
    definitions = definitions_of(kind, {kind: "Loop loop\ngeometry_msgs/Pose pose\n"})
    message = Messages.of("/tip", kind, [0], [b"\0\1\0\0" + bytes(80)])
    assert not FieldReader(POSE_TARGET, kind, "pose", definitions).read(message).valid.any()


# --- saved topics, command line -------------------------------------------------------------------------------------


def test_saved_topics_are_read_and_given_ones_win(tmp_path: Path) -> None:
    path = vicon_and_ur().mcap(tmp_path / "lab", original().rig)
    assert save_topics(path, replace(NAMES, pusher="/wrong")) == tmp_path / "lab.recording.yaml"
    with pytest.raises(RecordingError, match="pusher_topic '/wrong'"):
        read_recording(path)
    found = read_recording(path, topics=Topics(pusher=UR))
    assert_same_windows(found)
    assert any("'vicon_world' is treated as 'world'" in note for note in found.notes)


def test_a_recorded_wrench_can_be_left_out(tmp_path: Path) -> None:
    path = vicon_and_ur().mcap(tmp_path / "lab", original().rig)
    save_topics(path, NAMES)
    assert read_recording(path).wrench is not None
    assert read_recording(path, topics=Topics(wrench="none")).wrench is None


@pytest.mark.parametrize("topics", [Topics(), NAMES, EVERY])
def test_saved_topics_come_back(tmp_path: Path, topics: Topics) -> None:
    save_topics(tmp_path / "a.b.mcap", topics)
    assert load_topics(tmp_path / "a.b.mcap") == topics
    assert topics_path(tmp_path / "a.b.mcap").name == "a.b.recording.yaml"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("slider: /a", "key 'slider' is not accepted, give slider_topic, pusher_topic, wrench_topic, covariate_topics"),
        ("slider_topic: 3", "slider_topic is 3, give a name"),
        ("slider_topic: ''", "slider_topic is '', give a name"),
        ("covariate_topics: /a", "covariate_topics is '/a', give a list of topics"),
        ("- a", r"contains \['a'\], give the keys slider_topic"),
        ("a: [", "cannot be read"),
    ],
)
def test_a_wrong_file_names_key_value_and_what_is_accepted(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "lab.recording.yaml").write_text(text)
    with pytest.raises(RecordingError, match=rf"lab\.recording\.yaml: {message}"):
        load_topics(tmp_path / "lab.mcap")


@pytest.mark.parametrize(
    ("key", "value", "accepted"),
    [
        ("wrench_bias", "zero", "free_motion or none"),
        ("stamp", "sent", "header or log"),
        *(("up", up, AXES) for up in ("q", "y,q", "tip=y", "slider=", "slider=y=z", "==")),
    ],
)
def test_another_value_is_refused_with_those_that_are_accepted(
    tmp_path: Path, key: str, value: str, accepted: str
) -> None:
    with pytest.raises(RequestError, match=f"{key}: .* is not accepted, give {accepted}"):
        Topics(**{key: value})  # type: ignore[arg-type]
    topics_path(tmp_path / "a.mcap").write_text(f"{key}: '{value}'\n")
    with pytest.raises(RecordingError, match=rf"a\.recording\.yaml: {key} is '{value}', give {accepted}"):
        load_topics(tmp_path / "a.mcap")


def test_commands_take_topics_and_save_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(vicon_and_ur().mcap(tmp_path / "lab", original().rig))
    names = ["--slider-topic", VICON, "--pusher-topic", UR, "--wrench-topic", "/netft"]
    model = str(tmp_path / "lab.pushmodel")
    assert main(["info", path]) == 1
    assert "give --slider-topic and --pusher-topic" in capsys.readouterr().err
    train = ["train", path, "--kind", "analytical", "--out", model]
    assert main(train) == 1
    assert main([*train, *names]) == 0
    assert not (tmp_path / "lab.recording.yaml").exists()
    assert main(["info", path, *names, "--world-frame", "vicon_world", "--save-topics"]) == 0
    assert load_topics(tmp_path / "lab") == replace(NAMES, world="vicon_world")
    for command in (["evaluate", model, path], ["validate", model, path], ["info", path]):
        assert main(command) == 0, capsys.readouterr().err
        assert main([*command, "--slider-topic", "/x"]) == 1
        assert "slider_topic '/x' (option --slider-topic): no such topic" in capsys.readouterr().err
    assert main(["info", path, "--wrench-topic", ":a"]) == 1
    assert "--wrench-topic: ':a' is not accepted, give TOPIC" in capsys.readouterr().err


def test_topics_are_not_saved_before_the_recording_was_read(tmp_path: Path) -> None:
    path = str(vicon_and_ur().mcap(tmp_path / "lab", original().rig))
    assert main(["info", path, "--slider-topic", "/x", "--save-topics"]) == 1
    assert not (tmp_path / "lab.recording.yaml").exists()


@pytest.mark.parametrize("command", ["train", "evaluate", "validate", "trace", "suggest", "report validation", "info"])
def test_every_command_that_reads_recordings_has_the_options(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([*command.split(), "--help"])
    shown = capsys.readouterr().out
    for option in ["slider-topic", "pusher-topic", "wrench-topic", "covariate-topic", "wrench-frame", "save-topics"]:
        assert f"--{option}" in shown
