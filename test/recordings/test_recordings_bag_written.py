# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Written bags: whole or not at all, in the format of rosbag2; other tools read ours and we read theirs."""

from __future__ import annotations

import re
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.opcode import Opcode

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.message_types import FLOAT64, POSE, WRENCH
from push_predictor.recordings.bag.messages import encode
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.recordings.bag.writer import BagWriter
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.write import write_recording

N = 40
STAMP = 1_700_000_000_000_000_000 + 4_000_000 * np.arange(N, dtype=np.int64)
# Writing


def test_failed_write_leaves_the_earlier_bag_and_no_temporary_file(tmp_path: Path, recording: Recording) -> None:
    write_recording(tmp_path / "a", recording)
    before = (tmp_path / "a" / "a_0.mcap").read_bytes()
    with pytest.raises(RuntimeError, match="power cut"), BagWriter(tmp_path / "a") as writer:
        writer.add_topic("x", FLOAT64.name, FLOAT64.definition)
        raise RuntimeError("power cut")
    assert [p.name for p in tmp_path.iterdir()] == ["a"]
    assert (tmp_path / "a" / "a_0.mcap").read_bytes() == before


@pytest.mark.parametrize("name", ["a", "a.mcap"])
def test_earlier_bag_is_replaced(tmp_path: Path, recording: Recording, name: str) -> None:
    write_recording(tmp_path / name, recording)
    write_recording(tmp_path / name, replace(recording, wrench=None))
    assert read_recording(tmp_path / name).wrench is None
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_folder_with_other_files_is_not_replaced(tmp_path: Path, recording: Recording) -> None:
    (tmp_path / "notes.txt").write_text("dear diary")
    with pytest.raises(RecordingError, match="exists and is not a bag"):
        write_recording(tmp_path, recording)
    assert (tmp_path / "notes.txt").read_text() == "dear diary"


def test_invalid_recording_is_not_written(tmp_path: Path, recording: Recording) -> None:
    with pytest.raises(RecordingError, match="compression: 'rar', give one of zstd, lz4, none"):
        write_recording(tmp_path / "a", recording, compression="rar")
    early = replace(recording, pusher=replace(recording.pusher, stamp=recording.pusher.stamp - 2 * 10**18))
    with pytest.raises(RecordingError, match="/pusher/pose stamp -"):
        write_recording(tmp_path / "a", early)
    late = replace(recording, slider=replace(recording.slider, stamp=recording.slider.stamp * 4))
    with pytest.raises(RecordingError, match="32-bit seconds"):
        write_recording(tmp_path / "a", late)
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot be written"):
        write_recording(tmp_path / "file" / "a", recording)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_metadata_yaml_has_the_format_of_rosbag2_jazzy(tmp_path: Path, recording: Recording) -> None:
    """The keys are those that rosbag2_storage/yaml.hpp reads; custom_data must be text throughout."""
    write_recording(tmp_path / "a", recording)
    info = yaml.safe_load((tmp_path / "a" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (info["version"], info["storage_identifier"], info["ros_distro"]) == (9, "mcap", "jazzy")
    counts = {t["topic_metadata"]["name"]: t["message_count"] for t in info["topics_with_message_count"]}
    assert counts == {"/slider/pose": 250, "/pusher/pose": 250, "/pusher/wrench": 250, "/table/temperature": 10}
    assert info["message_count"] == info["files"][0]["message_count"] == 760
    assert info["relative_file_paths"] == [info["files"][0]["path"]] == ["a_0.mcap"]
    assert info["starting_time"]["nanoseconds_since_epoch"] == recording.slider.stamp[0]
    last = recording.pusher.stamp[-1] + 1_000_000
    assert info["duration"]["nanoseconds"] == last - recording.slider.stamp[0]
    assert (info["compression_format"], info["compression_mode"]) == ("", "")
    assert all(isinstance(value, str) for value in info["custom_data"].values())
    for topic in info["topics_with_message_count"]:
        described = topic["topic_metadata"]
        assert described["serialization_format"] == "cdr" and described["type_description_hash"].startswith("RIHS01_")
        (qos,) = described["offered_qos_profiles"]
        assert (qos["reliability"], qos["history"], qos["durability"]) == ("reliable", "keep_last", "volatile")


def opcodes(data: bytes) -> dict[int, int]:
    """The opcode of each record of an MCAP file, by its place."""
    found, place = {}, 8
    while place < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, place)
        found[place] = opcode
        place += 9 + length
    return found


@pytest.mark.parametrize("live", [False, True])
@pytest.mark.parametrize("with_rig", [False, True])
def test_every_group_that_the_summary_points_to_has_records(tmp_path: Path, with_rig: bool, live: bool) -> None:
    with BagWriter(tmp_path / "a.mcap", live=live) as writer:
        writer.add_topic("x", FLOAT64.name, FLOAT64.definition)
        if with_rig:
            writer.add_metadata("push_rig", {"shape": "square"})
        writer.write("x", 1, bytes(12))
    data = (tmp_path / "a.mcap").read_bytes()
    places = opcodes(data)
    *_, (footer, last) = places.items()
    start, _, _ = struct.unpack_from("<QQI", data, footer + 9)
    assert last == Opcode.FOOTER and places[start] == Opcode.SCHEMA
    indexed = {Opcode.CHANNEL, Opcode.STATISTICS, Opcode.CHUNK_INDEX} | ({Opcode.METADATA_INDEX} if with_rig else set())
    assert indexed <= {opcode for place, opcode in places.items() if place > start}
    for place in (place for place, opcode in places.items() if opcode == Opcode.SUMMARY_OFFSET):
        opcode, begin, length = struct.unpack_from("<BQQ", data, place + 9)
        assert length and places[begin] == opcode, f"a group of {Opcode(opcode).name} has no record"


# Others read it


def test_decoder_of_the_mcap_package_reads_our_bags(tmp_path: Path, recording: Recording) -> None:
    reader = pytest.importorskip("mcap_ros2.reader")
    write_recording(tmp_path / "a.mcap", recording)
    found = list(reader.read_ros2_messages(str(tmp_path / "a.mcap"), topics=["/slider/pose"]))
    assert [m.ros_msg.pose.position.x for m in found] == recording.slider.x.tolist()
    assert {m.ros_msg.header.frame_id for m in found} == {"world"}
    force = [m.ros_msg for m in reader.read_ros2_messages(str(tmp_path / "a.mcap"), topics=["/pusher/wrench"])]
    assert recording.wrench is not None
    assert [m.wrench.force.y for m in force] == recording.wrench.fy.tolist()


def test_package_rosbags_reads_our_bags_and_we_read_its_bags(tmp_path: Path, recording: Recording) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    write_recording(tmp_path / "a", recording)
    with rosbag2.Reader(tmp_path / "a") as reader:
        assert {c.topic: c.msgtype for c in reader.connections} == open_bag(tmp_path / "a").topics
        assert all(len(c.ext.offered_qos_profiles) == 1 for c in reader.connections)
        messages = list(reader.messages())
        first = store.deserialize_cdr(messages[0][2], messages[0][0].msgtype)
    assert first.pose.position.z == recording.slider.z[0]
    with rosbag2.Writer(tmp_path / "b", version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        topics = {
            c.topic: writer.add_connection(c.topic, c.msgtype, typestore=store)
            for c in {m[0].topic: m[0] for m in messages}.values()
        }
        for connection, stamp, data in messages:
            writer.write(topics[connection.topic], stamp, data)
    again = read_recording(tmp_path / "b")
    np.testing.assert_array_equal(again.slider.heading, read_recording(tmp_path / "a").slider.heading)
    assert set(again.scalars) == {"/table/temperature"}


@pytest.mark.parametrize("mode", ["MESSAGE", "FILE"])
def test_bags_compressed_by_rosbag2_are_decompressed(tmp_path: Path, recording: Recording, mode: str) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    write_recording(tmp_path / "plain", recording)
    bag = open_bag(tmp_path / "plain")
    writer = rosbag2.Writer(tmp_path / "packed", version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
    writer.set_compression(rosbag2.CompressionMode[mode], rosbag2.CompressionFormat.ZSTD)
    with writer:
        store = get_typestore(Stores.ROS2_JAZZY)
        topics = {name: writer.add_connection(name, kind, typestore=store) for name, kind in bag.topics.items()}
        for message in bag.messages():
            writer.write(topics[message.topic], message.log_time, message.data)
    for _ in range(2):
        read = read_recording(tmp_path / "packed")
        assert read.notes == ()
        np.testing.assert_array_equal(read.slider.x, recording.slider.x)
        (tmp_path / "packed" / "metadata.yaml").unlink(missing_ok=True)  # the bytes show the compression
    if mode == "FILE":
        (tmp_path / "packed" / "packed.mcap.zstd").write_bytes(b"no zstd")
        with pytest.raises(RecordingError, match=r"packed\.mcap\.zstd: cannot be decompressed"):
            read_recording(tmp_path / "packed")


def test_messages_that_cannot_be_decompressed_are_skipped_and_counted(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "a") as writer:
        writer.add_topic("x", FLOAT64.name, FLOAT64.definition)
        for k, data in enumerate((b"\x28\xb5\x2f\xfd damaged", *encode(STAMP[:2], np.ones((2, 1)), header=False))):
            writer.write("x", k, data)
    bag = open_bag(tmp_path / "a")
    assert len(list(bag.messages())) == 2
    (note,) = bag.notes.losses
    assert re.fullmatch(r".*a_0\.mcap at byte \d+: 1 messages cannot be decompressed and were skipped", note)


def test_metadata_that_wrongly_state_a_compression_change_nothing(tmp_path: Path, recording: Recording) -> None:
    write_recording(tmp_path / "a", recording)
    text = (tmp_path / "a" / "metadata.yaml").read_text()
    changed = text.replace("compression_format: ''", "compression_format: zstd")
    (tmp_path / "a" / "metadata.yaml").write_text(changed.replace("compression_mode: ''", "compression_mode: MESSAGE"))
    assert len(read_recording(tmp_path / "a").slider) == len(recording.slider)


def test_definitions_and_hashes_equal_those_of_ros(tmp_path: Path) -> None:
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for kind in (POSE, WRENCH, FLOAT64):
        parsed = typesys.get_types_from_msg(kind.definition, kind.name)
        assert set(parsed) <= set(store.fielddefs)
        assert store.hash_rihs01(kind.name) == kind.type_hash
        ours = typesys.get_typestore(typesys.Stores.EMPTY)
        ours.register(parsed)
        assert ours.hash_rihs01(kind.name) == kind.type_hash


def test_rclpy_reads_our_bytes_and_writes_the_same() -> None:
    serialization = pytest.importorskip("rclpy.serialization")
    from geometry_msgs.msg import PoseStamped, WrenchStamped
    from std_msgs.msg import Float64

    values = np.arange(1.0, 8.0)[None]
    ours = encode(STAMP[1:2], values)[0]
    pose = serialization.deserialize_message(ours, PoseStamped)
    assert (pose.header.stamp.sec, pose.header.stamp.nanosec) == divmod(int(STAMP[1]), 10**9)
    assert (pose.header.frame_id, pose.pose.position.y, pose.pose.orientation.w) == ("world", 2.0, 7.0)
    wrench = encode(STAMP[1:2], values[:, :6])[0]
    scalar = encode(STAMP[1:2], values[:, :1], header=False)[0]
    for data, kind in ((ours, PoseStamped), (wrench, WrenchStamped), (scalar, Float64)):
        theirs = serialization.serialize_message(serialization.deserialize_message(data, kind))
        padding = slice(22, 28) if kind is not Float64 else slice(0, 0)  # left uninitialised by Fast CDR
        assert bytearray(theirs)[: padding.start] == bytearray(data)[: padding.start]
        assert theirs[padding.stop :] == data[padding.stop :]
