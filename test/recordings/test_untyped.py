# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Topics that were recorded without a schema: their type is told from their bytes, or they are refused by name."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags")
from lab_bags import LABORATORY, Lab, assign, laboratory, short_recording, write_without_schema, zeros

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.message_types import POSE, WRENCH
from push_predictor.recordings.checks.check import check_recording
from push_predictor.recordings.fields.sources import POSE_TARGET, SCALAR_TARGET, WRENCH_TARGET, Source
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.untyped_topics import candidates, told_type

ODOMETRY = "nav_msgs/msg/Odometry"
KINDS = [*POSE_TARGET.known, *WRENCH_TARGET.known, "tf2_msgs/msg/TFMessage"]


def message(kind: str = POSE.name, **values: object) -> bytes:
    """A message of zeros but for an identity as quaternion, and values by their path."""
    lab = Lab()
    made = zeros(lab.store, kind)
    for path, value in {"pose.orientation.w": 1.0, **values}.items():
        assign(made, path, value)
    return bytes(lab.store.serialize_cdr(made, kind))


def short() -> Recording:
    return short_recording(2.0)


def test_a_laboratory_without_any_schema_reads_as_with_them(tmp_path: Path) -> None:
    lab = laboratory(short())
    found = read_recording(write_without_schema(lab, tmp_path / "a.mcap", *lab.kinds), topics=LABORATORY)
    wanted = read_recording(lab.mcap(tmp_path / "b.mcap"), topics=LABORATORY)
    for stream in ("slider", "pusher", "wrench"):
        assert getattr(found, stream).stamp.tolist() == getattr(wanted, stream).stamp.tolist()
    assert found.slider.x.tolist() == wanted.slider.x.tolist() and found.pusher.x.tolist() == wanted.pusher.x.tolist()
    assert [note for note in found.notes if "without a schema" in note] == [
        f"{topic} was recorded without a schema; its messages are read as {lab.kinds[topic]}"
        for topic in ("/tf", "/tf_static", LABORATORY.slider, LABORATORY.wrench)
    ]
    assert not found.losses


@pytest.mark.parametrize(
    ("data", "fits"),
    [
        (message(), True),
        (message(**{"header.frame_id": "vicon/world"}), True),
        (message(**{"pose.orientation.w": 0.0}), True),  # of a lost body
        (message(**{"pose.position.x": float("nan")}), True),
        (message(**{"pose.orientation.w": 0.9}), False),
        (message(**{"pose.position.x": 1e12}), False),
        (message(**{"pose.position.x": 1e-200}), False),
        (message(**{"header.stamp.nanosec": 1_000_000_000}), False),
        (message(**{"header.frame_id": "a\tb"}), False),
        (message() + bytes(8), False),
        (message()[:-8], False),
        (b"\0\7" + message()[2:], False),
        (b"", False),
    ],
)
def test_a_message_fits_a_type_by_length_texts_stamps_and_quaternions(data: bytes, fits: bool) -> None:
    assert (told_type([data], [POSE.name]) == POSE.name) is fits


def test_one_message_in_ten_may_be_of_a_lost_body() -> None:
    lost = message(**{"pose.orientation.w": 0.5})
    assert told_type([message()] * 9 + [lost], [POSE.name]) == POSE.name
    assert told_type([message()] * 8 + [lost] * 2, [POSE.name]) == ""
    assert told_type([], [POSE.name]) == ""


def test_a_field_or_a_frame_decides_which_types_are_tried() -> None:
    def of(text: str, target: object = POSE_TARGET) -> list[str]:
        return candidates(Source("slider_topic", text), target)  # type: ignore[arg-type]

    assert of("/tf:block") == ["tf2_msgs/msg/TFMessage"]
    assert of("/a") == list(POSE_TARGET.known)
    assert set(of("/a.pose.pose")) == {ODOMETRY, "geometry_msgs/msg/PoseWithCovarianceStamped"}
    assert "std_msgs/msg/Float64" in of("/a", SCALAR_TARGET)
    assert told_type([b"\0\1\0\0" + struct.pack("<d", 21.5)], of("/a", SCALAR_TARGET)) == "std_msgs/msg/Float64"


def blob_lab() -> Lab:
    lab = laboratory(short())
    lab.kinds["/blob"] = POSE.name
    lab.messages += [(int(stamp), "/blob", b"\0\1\0\0" + bytes(17)) for stamp in short().slider.stamp[:5]]
    return lab


def test_a_pose_that_fits_no_type_is_refused_by_name_and_another_topic_is_a_note(tmp_path: Path) -> None:
    path = write_without_schema(blob_lab(), tmp_path / "a.mcap", "/blob")
    with pytest.raises(
        RecordingError, match=r"slider_topic '/blob' .*/blob was recorded without a schema, and its .* "
    ):
        read_recording(path, topics=Topics("/blob", LABORATORY.pusher))
    found = read_recording(path, topics=LABORATORY)
    assert "/blob was recorded without a schema and is not read" in found.notes and not found.losses


def test_a_wrench_that_fits_no_type_is_a_loss_that_check_names(tmp_path: Path) -> None:
    lab = blob_lab()
    lab.kinds["/pusher/wrench"] = WRENCH.name
    lab.messages += [(stamp, "/pusher/wrench", data) for stamp, topic, data in lab.messages if topic == "/blob"]
    path = write_without_schema(lab, tmp_path / "a.mcap", "/pusher/wrench")
    found = read_recording(path, rig=short().rig, topics=Topics(LABORATORY.slider, LABORATORY.pusher))
    assert found.wrench is None
    assert found.losses == ("/pusher/wrench was recorded without a schema and is not read",)
    assert found.rig is not None and check_recording(found, found.rig)[0].name == "data_lost"
    with pytest.raises(RecordingError, match="wrench_topic 'pusher/wrench'"):
        read_recording(path, topics=Topics(LABORATORY.slider, LABORATORY.pusher, "pusher/wrench"))


def test_a_quaternion_of_32_bits_is_one(tmp_path: Path) -> None:
    half = float(np.float32(np.sqrt(0.5)))
    assert told_type([message(**{"pose.orientation.w": half, "pose.orientation.z": half})], [POSE.name]) == POSE.name


@pytest.mark.parametrize("untyped", [0, 1])
def test_a_type_that_one_file_of_a_bag_has_is_that_of_the_others(tmp_path: Path, untyped: int) -> None:
    for number in range(2):
        lab = laboratory(short_recording(1.0, after=float(number)))
        topics = list(lab.kinds) if number == untyped else []
        write_without_schema(lab, tmp_path / f"part_{number}.mcap", *topics)
    found = read_recording(tmp_path, topics=LABORATORY)
    assert len(found.slider) == len(short().slider) and not found.losses
    assert not any("without a schema" in note for note in found.notes)
