# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Poses in arrays, matrices and pairs of fields: chosen by name, in the order that the numbers show."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("rosbags")
from lab_bags import LATENCY, Lab, assign, pose_rows, pose_values, short_recording, zeros

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.message_types import parse_definitions, steps_of, type_at
from push_predictor.recordings.fields.pose_rows import UP_AXES, normalised, pose_rows_of, turned
from push_predictor.recordings.fields.sources import (
    POSE_TARGET,
    SCALAR_TARGET,
    WRENCH_TARGET,
    Source,
    field_to_read,
    fields_in,
)
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.topics import Topics

BODIES, BODY, ARM = "lab_msgs/msg/Bodies", "lab_msgs/msg/Body", "lab_msgs/msg/Arm"
TYPES = {
    BODIES: "std_msgs/Header header\nuint32 count\nBody[] bodies\n",
    BODY: "string name\nint32 id\ngeometry_msgs/Point[] markers\nstring[] tags\ngeometry_msgs/Pose pose\n",
    ARM: "std_msgs/Header header\nfloat64[16] square\nfloat32[12] flat\nfloat64[9] rotation\nfloat64[3] position\n"
    "geometry_msgs/Quaternion turn\nfloat64[] any\nfloat64[6] joints\n",
}


def original() -> Recording:
    return short_recording(1.5)


def body(lab: Lab, name: str, number: int, row: Any, markers: int = 2) -> Any:
    made = zeros(lab.store, BODY)
    for path, value in pose_values(row, "pose", ("position", "orientation")).items():
        assign(made, path, value)
    made.name, made.id, made.tags = name, number, ["block"]
    made.markers = [zeros(lab.store, "geometry_msgs/msg/Point")] * markers
    return made


def bodies_lab(choose: Any) -> Lab:
    """A slider `block` of number 7 and another body; choose: from them and the number of the message."""
    lab, slider = Lab(TYPES), original().slider
    lab.pose("/pusher/pose", "geometry_msgs/msg/PoseStamped", original().pusher, "pose")
    other = [0.4, 0.1, 0.0, 0.0, 0.0, 0.0, 1.0]
    lab.add("/bodies", BODIES, slider.stamp, (
        {**lab.header(stamp), "bodies": choose(k, body(lab, "block", 7, row), body(lab, "a thing", 3, np.array(other)))}
        for k, (stamp, row) in enumerate(zip(slider.stamp.tolist(), pose_rows(slider), strict=True))
    ))  # fmt: skip
    return lab


@pytest.fixture(scope="module")
def shuffled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The order changes at random, either body may be missing, and the number of markers changes."""
    rng = np.random.default_rng(0)

    def chosen(number: int, block: Any, other: Any) -> list[Any]:
        block.markers = block.markers[: number % 3]
        both = [block, other] if rng.random() < 0.5 else [other, block]
        return both if number % 7 else [other] if number % 14 else [block]

    return bodies_lab(chosen).mcap(tmp_path_factory.mktemp("bodies") / "a.mcap", original().rig)


def test_a_plus_in_a_name_joins_no_fields() -> None:
    assert fields_in("bodies[tip+flange].pose") == ["bodies[tip+flange].pose"]
    assert fields_in("bodies[a+b].position+turn") == ["bodies[a+b].position", "turn"]


@pytest.mark.parametrize("choice", ["block", "name=block", "id=7", "id=7.0"])
def test_a_body_is_chosen_by_any_text_or_by_one_field_in_whatever_order(shuffled: Path, choice: str) -> None:
    found = read_recording(shuffled, topics=Topics(f"/bodies.bodies[{choice}].pose"))
    slider, numbers = original().slider, np.arange(len(original().slider))
    there = numbers % 14 != 7
    assert found.slider.stamp.tolist() == slider.stamp[there].tolist()
    assert found.slider.x.tolist() == slider.x[there].tolist()
    note = f"/bodies.bodies[{choice}].pose: {np.sum(~there)} messages lack the chosen element, "
    assert any(each.startswith(note) for each in found.notes) and not found.losses


def test_of_two_bodies_of_one_name_the_first_is_taken(tmp_path: Path) -> None:
    def chosen(number: int, block: Any, other: Any) -> list[Any]:
        other.name = "block"
        return [block, other]

    path = bodies_lab(chosen).mcap(tmp_path / "a.mcap")
    found = read_recording(path, topics=Topics("/bodies.bodies[name=block].pose"))
    assert found.slider.x.tolist() == original().slider.x.tolist()


def test_two_fields_of_a_chosen_body_are_of_the_same_body(shuffled: Path) -> None:
    text = "/bodies.bodies[block].pose.orientation+bodies[block].pose.position"
    one, other = (read_recording(shuffled, topics=Topics(t)).slider for t in (text, "/bodies.bodies[block].pose"))
    assert one.x.tolist() == other.x.tolist() and one.heading.tolist() == other.heading.tolist()


@pytest.mark.parametrize("choice", ["blok", "name=a", "id=8", "id=block"])
def test_a_body_that_is_never_there_is_refused_with_the_names_that_are(shuffled: Path, choice: str) -> None:
    with pytest.raises(RecordingError, match=r"lack the chosen element.*The elements are named 'a thing', 'block'"):
        read_recording(shuffled, topics=Topics(f"/bodies.bodies[{choice}].pose"))


@pytest.mark.parametrize("choice", ["", "name", "pose=1", "markers=1", "tags=block", "none=1"])
def test_a_choice_by_what_no_element_can_have_is_refused(shuffled: Path, choice: str) -> None:
    if choice == "name":
        with pytest.raises(RecordingError, match="lack the chosen element"):
            read_recording(shuffled, topics=Topics("/bodies.bodies[name].pose"))
        return
    with pytest.raises(RecordingError, match=r"/bodies.bodies\[NAME\].pose chooses the element with this name"):
        read_recording(shuffled, topics=Topics(f"/bodies.bodies[{choice}].pose"))


def test_a_number_of_a_chosen_element_is_a_covariate(shuffled: Path) -> None:
    name = "/bodies.bodies[block].id"
    found = read_recording(shuffled, topics=Topics("/bodies.bodies[block].pose", covariates=(name,)))
    assert set(found.scalars[name].value.tolist()) == {7.0}


def test_an_element_of_tf_has_its_own_header(tmp_path: Path) -> None:
    lab, slider = Lab(), original().slider
    lab.pose("/pusher/pose", "geometry_msgs/msg/PoseStamped", original().pusher, "pose")
    lab.transform("/tf", "world", "block", slider.stamp, pose_rows(slider))
    path = lab.mcap(tmp_path / "a.mcap")
    found = read_recording(path, topics=Topics("/tf.transforms[child_frame_id=block].transform"))
    assert found.slider.stamp.tolist() == slider.stamp.tolist() and found.slider.x.tolist() == slider.x.tolist()


def test_the_steps_of_a_path_keep_dots_in_brackets() -> None:
    assert [step.text for step in steps_of("a.b[x=c.d e].f[3]")] == ["a", "b[x=c.d e]", "f[3]"]
    assert [step.chooses for step in steps_of("a.b[x].f[3]")] == [False, True, False]
    for wrong in ("", "a.", ".a", "a..b", "a[b", "a]b", "a[b]c"):
        assert steps_of(wrong) == []
    assert Source("", "/t.b[x:y.z].pose").field == "b[x:y.z].pose" and not Source("", "/t.b[x:y]").frame
    assert Source("", "/tf:a.b").frame == "a.b" and not Source("", "/tf:a.b").field


def test_the_type_of_an_array_has_its_length() -> None:
    definitions = parse_definitions(ARM, TYPES[ARM])
    assert type_at(definitions, ARM, "square") == "float64[16]" and type_at(definitions, ARM, "any") == "float64[]"
    assert type_at(definitions, ARM, "square[3]") == "float64" and type_at(definitions, ARM, "turn[3]") is None


# --- numbers ----------------------------------------------------------------------------------------------------------


def rotation_of(quaternion: np.ndarray) -> np.ndarray:
    """Matrices (n, 3, 3) whose columns are the turned axes."""
    axes = [turned(quaternion, np.tile(axis, (len(quaternion), 1))) for axis in np.eye(3)]
    return np.stack(axes, axis=2)


def matrices(rows: np.ndarray) -> np.ndarray:
    found = np.tile(np.eye(4), (len(rows), 1, 1))
    found[:, :3, :3], found[:, :3, 3] = rotation_of(rows[:, 3:]), rows[:, :3]
    return found


def numbers_of(rows: np.ndarray) -> dict[str, list[np.ndarray]]:
    whole, n = matrices(rows), len(rows)
    rotation = whole[:, :3, :3].reshape(n, 9)
    return {
        "4x4 by row": [whole.reshape(n, 16)],
        "4x4 by column": [whole.transpose(0, 2, 1).reshape(n, 16)],
        "3x4 by row": [whole[:, :3].reshape(n, 12)],
        "3x4 by column": [whole[:, :3].transpose(0, 2, 1).reshape(n, 12)],
        "position, rotation": [rows[:, :3], rotation],
        "rotation, position": [rotation, rows[:, :3]],
        "quaternion, position": [rows[:, 3:], rows[:, :3]],
        "position, quaternion": [rows[:, :3], rows[:, 3:]],
        "pose": [rows],
    }


def assert_same_rows(found: np.ndarray | None, rows: np.ndarray, digits: float = 1e-9) -> None:
    assert found is not None
    sign = np.sign(np.sum(found[:, 3:] * rows[:, 3:], axis=1, keepdims=True))
    np.testing.assert_allclose(np.hstack([found[:, :3], sign * found[:, 3:]]), rows, atol=digits)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 4), st.sampled_from(sorted(numbers_of(np.ones((1, 7))))))
def test_poses_of_all_kinds_of_numbers_are_the_same(seed: int, count: int, kind: str) -> None:
    rows = normalised(np.random.default_rng(seed).normal(size=(count, 7)))
    assert_same_rows(pose_rows_of(numbers_of(rows)[kind]), rows)


@pytest.mark.parametrize("axis", UP_AXES)
def test_turns_by_half_and_quarter_about_an_axis_keep_their_quaternion(axis: str) -> None:
    for angle in (0.5 * np.pi, np.pi):
        vector = np.array([{"x": 1.0, "y": 2.0, "z": 3.0}[axis[-1]] == k for k in (1.0, 2.0, 3.0)], np.float64)
        turn = [*(np.sin(angle / 2) * vector * (-1 if axis[0] == "-" else 1)), np.cos(angle / 2)]
        rows = np.array([[0.1, 0.2, 0.3, *turn]])
        assert_same_rows(pose_rows_of(numbers_of(rows)["4x4 by column"]), rows)


def test_a_matrix_that_is_no_pose_is_no_sample() -> None:
    rows = normalised(np.random.default_rng(1).normal(size=(6, 7)))
    whole = matrices(rows)
    whole[0, 0, 0] += 0.1  # sheared
    whole[1, :3, 0] *= -1.0  # mirrored
    whole[2, 3, 3] = 2.0
    whole[3] = 0.0
    whole[4, 1, 1] = np.nan
    found = pose_rows_of([whole.reshape(6, 16)])
    assert found is not None and np.isnan(found[:5]).all()
    assert_same_rows(found[5:], rows[5:])
    for sizes in ((6,), (3,), (3, 6), (4, 9), (3, 3)):
        assert pose_rows_of([np.ones((2, size)) for size in sizes]) is None


def test_a_matrix_that_was_rounded_to_three_decimals_is_a_pose() -> None:
    rows = normalised(np.random.default_rng(2).normal(size=(50, 7)))
    assert_same_rows(pose_rows_of([np.round(matrices(rows), 3).reshape(50, 16)]), rows, 2e-3)


@pytest.mark.parametrize(
    ("field", "name"),
    [
        ("square", "4x4 by column"),
        ("flat", "3x4 by row"),
        ("any", "4x4 by row"),
        ("rotation+position", "rotation, position"),
        ("position+turn", "pose"),
    ],
)
def test_a_robots_matrix_gives_the_poses_of_the_tip(tmp_path: Path, field: str, name: str) -> None:
    lab, pusher = Lab(TYPES), original().pusher
    lab.pose("/slider/pose", "geometry_msgs/msg/PoseStamped", original().slider, "pose")
    rows = pose_rows(pusher)
    parts = [part.astype(np.float32) if field == "flat" else part for part in numbers_of(rows)[name]]
    fields = field.split("+")

    def values(k: int) -> dict[str, object]:
        if name == "pose":
            turn = {f"turn.{axis}": rows[k, 3 + number] for number, axis in enumerate("xyzw")}
            return {"position": rows[k, :3], **turn}
        return {each: part[k] for each, part in zip(fields, parts, strict=True)}

    lab.add("/arm", ARM, pusher.stamp, ({**lab.header(s), **values(k)} for k, s in enumerate(pusher.stamp.tolist())))
    found = read_recording(lab.mcap(tmp_path / "a.mcap"), topics=Topics(pusher=f"/arm.{field}")).pusher
    assert found.stamp.tolist() == pusher.stamp.tolist()
    np.testing.assert_allclose([found.x, found.y, found.z], [pusher.x, pusher.y, pusher.z], atol=1e-7)
    np.testing.assert_allclose(found.heading, pusher.heading, atol=1e-6)


@pytest.mark.parametrize("field", ["joints", "position", "rotation+turn", "square+position", "position+turn+any", ""])
def test_numbers_that_are_no_pose_are_refused_with_those_that_can_be(field: str) -> None:
    source, lab = Source("pusher_topic", f"/arm.{field}" if field else "/arm"), Lab(TYPES)
    with pytest.raises(RecordingError, match=r"give one of its fields: /arm.square, /arm.flat$"):
        field_to_read(source, ARM, POSE_TARGET, {ARM: lab.definition(ARM)}, "")


def test_a_pose_and_a_wrench_without_a_header_have_the_time_of_the_log(tmp_path: Path) -> None:
    lab, whole = Lab(), original()
    assert whole.wrench is not None
    for topic, stream in (("/slider/pose", whole.slider), ("/pusher/pose", whole.pusher)):
        rows = zip(stream.stamp.tolist(), pose_rows(stream), strict=True)
        values = (pose_values(row, "", ("position", "orientation")) for _, row in rows)
        lab.add(topic, "geometry_msgs/msg/Pose", stream.stamp, ({k[1:]: v for k, v in of.items()} for of in values))
    lab.add("/pusher/wrench", "geometry_msgs/msg/Wrench", whole.wrench.stamp, ({"force.x": x} for x in whole.wrench.fx))
    found = read_recording(lab.mcap(tmp_path / "a.mcap"))
    assert found.slider.stamp.tolist() == (whole.slider.stamp + LATENCY).tolist()
    assert found.slider.x.tolist() == whole.slider.x.tolist() and not found.losses
    assert found.wrench is not None and found.wrench.fx.tolist() == whole.wrench.fx.tolist()
    assert WRENCH_TARGET.known["geometry_msgs/msg/Wrench"] == "force+torque" and not any(SCALAR_TARGET.pieces)


def test_an_array_that_is_no_pose_is_refused_as_such_and_zeros_are_a_dropout(tmp_path: Path) -> None:
    lab, pusher = Lab(TYPES), original().pusher
    lab.pose("/slider/pose", "geometry_msgs/msg/PoseStamped", original().slider, "pose")
    rows = numbers_of(pose_rows(pusher))["4x4 by column"][0]
    rows[10:20] = 0.0
    lab.add("/arm", ARM, pusher.stamp, (
        {**lab.header(stamp), "square": rows[k], "flat": np.full(12, np.float32(k))}
        for k, stamp in enumerate(pusher.stamp.tolist())
    ))  # fmt: skip
    path = lab.mcap(tmp_path / "a.mcap")
    found = read_recording(path, topics=Topics(pusher="/arm.square"))
    assert found.pusher.stamp.tolist() == np.delete(pusher.stamp, np.arange(10, 20)).tolist()
    assert "/arm.square: 10 messages lack the chosen element, or their matrix is no pose; discarded" in found.notes
    with pytest.raises(RecordingError, match=r"no usable sample .*, or their matrix is no pose; discarded\)$"):
        read_recording(path, topics=Topics(pusher="/arm.flat"))
