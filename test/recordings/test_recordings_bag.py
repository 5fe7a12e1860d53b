# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Bags as written by rosbag2 and other tools, intact and damaged."""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pytest
import yaml
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer

from push_predictor.errors import RecordingError, RigError
from push_predictor.recordings.bag.message_types import FLOAT64, POSE, WRENCH, MessageType
from push_predictor.recordings.bag.messages import encode
from push_predictor.recordings.bag.reader import open_bag
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.write import write_recording

N = 40
STAMP = 1_700_000_000_000_000_000 + 4_000_000 * np.arange(N, dtype=np.int64)
POSES = np.column_stack([0.001 * np.arange(N), np.zeros((N, 5)), np.ones(N)])
Content = dict[str, tuple[MessageType, list[bytes]]]


def pose_topics() -> Content:
    messages = encode(STAMP, POSES)
    return {"/slider/pose": (POSE, messages), "/pusher/pose": (POSE, messages)}


def write_mcap(path: Path, topics: Content, stamp: np.ndarray = STAMP, **options: object) -> Path:
    """A file written by the mcap package; metadata=(name, record) is at its end, encoding is that of the channels."""
    metadata, encoding = options.pop("metadata", None), str(options.pop("encoding", "cdr"))
    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="ros2")
        channels = {}
        for name, (kind, _) in topics.items():
            schema = writer.register_schema(kind.name, "ros2msg", kind.definition.encode())
            channels[name] = writer.register_channel(name, encoding, schema)
        for i, t in enumerate(stamp.tolist()):
            for name, (_, messages) in topics.items():
                if i < len(messages):
                    writer.add_message(channels[name], t, messages[i], t)
        if metadata:
            writer.add_metadata(*metadata)
        writer.finish()
    return path


def test_file_and_folder_with_and_without_metadata_yaml_read_equally(recording: Recording, tmp_path: Path) -> None:
    write_recording(tmp_path / "push", recording)
    shutil.copytree(tmp_path / "push", tmp_path / "copy")
    (tmp_path / "copy" / "metadata.yaml").unlink()
    whole, unlisted = read_recording(tmp_path / "push"), read_recording(tmp_path / "copy")
    bare = read_recording(tmp_path / "push" / "push_0.mcap")
    assert (whole.name, unlisted.name, bare.name) == ("push", "copy", "push_0")
    for other in (unlisted, bare):
        np.testing.assert_array_equal(other.slider.x, whole.slider.x)
        assert other.rig is not None and whole.rig is not None
        assert other.rig.to_record() == whole.rig.to_record()


@pytest.mark.parametrize("listed", [True, False])
def test_several_files_are_read_in_the_order_of_the_bag(tmp_path: Path, listed: bool) -> None:
    """By number, so that file 10 comes after file 2, or in the order of metadata.yaml."""
    parts = [2, 10, 1] if listed else [1, 2, 10]
    for place, part in enumerate(parts):
        one = {k: (kind, m[place : place + 1]) for k, (kind, m) in pose_topics().items()}
        write_mcap(tmp_path / f"bag_{part}.mcap", one)
    if listed:
        described = {"storage_identifier": "mcap", "relative_file_paths": [f"bag/bag_{part}.mcap" for part in parts]}
        (tmp_path / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": described}))
    np.testing.assert_array_equal(read_recording(tmp_path).slider.stamp, STAMP[:3])


@given(
    st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.integers(1, 255)), min_size=1, max_size=6), st.data()
)
def test_any_damage_gives_a_note_or_a_recording_error(hits: list[tuple[float, int]], data: st.DataObject) -> None:
    compression = data.draw(st.sampled_from([CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE]))
    with tempfile.TemporaryDirectory() as folder:
        path = write_mcap(Path(folder) / "a.mcap", pose_topics(), chunk_size=2000, compression=compression)
        damaged = bytearray(path.read_bytes())
        for place, change in hits:
            damaged[int(place * len(damaged))] ^= change
        path.write_bytes(damaged)
        try:
            read = read_recording(path)
        except (RecordingError, RigError):
            return
        assert len(read.slider) <= N
        assert len(read.slider) == N or read.notes or len(hits) > 1  # the summary may be hit as well


@given(
    rows=st.lists(st.tuples(st.sampled_from("ab"), st.binary(max_size=3), st.booleans()), max_size=40),
    chunked=st.booleans(),
    alike=st.booleans(),
)
def test_portions_have_the_messages_of_each_topic_in_their_order(
    rows: list[tuple[str, bytes, bool]], chunked: bool, alike: bool
) -> None:
    """Of equal length or not, empty, compressed one by one, in chunks and without."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "any.mcap"
        with path.open("wb") as stream:
            writer = Writer(stream, chunk_size=300, use_chunking=chunked)
            writer.start()
            schema = writer.register_schema("std_msgs/msg/Byte", "ros2msg", b"byte data\n")
            channels = {name: writer.register_channel(f"/{name}", "cdr", schema) for name in "ab"}
            for time, (name, content, packed) in enumerate(rows):
                data = b"\0\1\0\0" + content.ljust(3 * alike) if content or alike else b""
                data = zstandard.ZstdCompressor().compress(data) if packed else data
                writer.add_message(channels[name], time, data, time)
            writer.finish()
        bag = open_bag(path)
        each = list(bag.messages())
        assert len(each) == len(rows) and not bag.notes
        for topic in ("/a", "/b"):
            parts = list(bag.portions([topic, "/none"]))
            expected = [message for message in each if message.topic == topic]
            assert [time for part in parts for time in part.times.tolist()] == [m.log_time for m in expected]
            assert [size for part in parts for size in part.length.tolist()] == [len(m.data) for m in expected]
            assert b"".join(part.buffer for part in parts) == b"".join(m.data for m in expected)


@pytest.mark.parametrize("missing", [1, 3])
def test_of_an_lz4_chunk_that_is_cut_off_all_that_can_be_decoded_is_used(tmp_path: Path, missing: int) -> None:
    """The last bytes of a frame are its end mark alone."""
    path = random_messages(tmp_path / "cut.mcap", CompressionType.LZ4)
    data = path.read_bytes()
    end = data.index(b"lz4") + 3
    end += 8 + int.from_bytes(data[end : end + 8], "little")
    path.write_bytes(data[: end - missing])
    assert len(list(open_bag(path).messages())) == 300


def test_metadata_under_another_name_than_in_the_index_are_noted(tmp_path: Path) -> None:
    path = random_messages(tmp_path / "named.mcap", CompressionType.NONE)
    path.write_bytes(path.read_bytes().replace(b"push_rig", b"qush_rig", 1))
    notes = open_bag(path).notes
    assert any("is named 'qush_rig', but 'push_rig' in the index" in note for note in notes)


def random_messages(path: Path, compression: CompressionType) -> Path:
    """300 messages of random bytes in one chunk, and a metadata record after it."""
    rng = np.random.default_rng(1)
    with path.open("wb") as stream:
        writer = Writer(stream, compression=compression, chunk_size=1 << 20, enable_data_crcs=False)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/Byte", "ros2msg", b"byte data\n")
        channel = writer.register_channel("/a", "cdr", schema)
        for time in range(300):
            writer.add_message(channel, time, b"\0\1\0\0" + rng.bytes(100), time)
        writer.add_metadata("push_rig", {"shape": "square"})
        writer.finish()
    return path


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "the file is empty"),
        (b"velocity,contact\n1,2\n", "not an MCAP file"),
        (b"#ROSBAG V2.0\n" + b"x" * 50, "ROS 1 bag"),
        (b"SQLite format 3\0" + b"x" * 50, "sqlite3 bag"),
        (b"\x89MCAP0\r\n", "no topic /slider/pose and /pusher/pose"),
        (b"\x89MCAP0\r\n" + b"\xff" * 200, "no topic /slider/pose"),
    ],
)
def test_file_of_another_format_is_rejected_by_format(tmp_path: Path, content: bytes, reason: str) -> None:
    (tmp_path / "thing.mcap").write_bytes(content)
    with pytest.raises(RecordingError, match=f"thing.mcap: .*{reason}"):
        read_recording(tmp_path / "thing.mcap")


def test_folder_without_recordings_and_missing_path_are_errors(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"contains no \.mcap file"):
        read_recording(tmp_path)
    with pytest.raises(RecordingError, match=r"absent\.mcap: cannot be read"):
        read_recording(tmp_path / "absent.mcap")


def test_topic_of_another_type_or_encoding_or_without_messages_is_an_error(tmp_path: Path) -> None:
    poses = pose_topics()
    wrong = {**poses, "/slider/pose": (WRENCH, encode(STAMP, POSES[:, :6]))}
    with pytest.raises(RecordingError, match="topic /slider/pose is of type 'geometry_msgs/msg/WrenchStamped'"):
        read_recording(write_mcap(tmp_path / "wrong.mcap", wrong))
    with pytest.raises(RecordingError, match="/pose is encoded as 'json', cdr is accepted"):
        read_recording(write_mcap(tmp_path / "json.mcap", poses, encoding="json"))
    with pytest.raises(RecordingError, match="topic /pusher/pose contains no readable message"):
        read_recording(write_mcap(tmp_path / "none.mcap", {**poses, "/pusher/pose": (POSE, [])}))


def test_unusable_samples_are_discarded_and_counted(tmp_path: Path) -> None:
    values = POSES.copy()
    values[3, 0], values[5, 1], values[7, 3:] = np.nan, np.inf, 0.0
    messages = encode(STAMP, values)
    messages[9] = messages[9][:40]
    path = write_mcap(tmp_path / "a.mcap", {**pose_topics(), "/slider/pose": (POSE, messages)})
    read = read_recording(path)
    np.testing.assert_array_equal(read.slider.stamp, np.delete(STAMP, [3, 5, 7, 9]))
    assert "/slider/pose: 2 samples contain NaN or infinity; discarded" in read.notes
    assert "/slider/pose: 1 samples have no orientation; discarded" in read.notes
    assert "/slider/pose: 1 messages are not readable CDR; discarded" in read.notes
    assert len(read.pusher) == N


def test_heading_does_not_depend_on_norm_and_sign_of_the_quaternion(tmp_path: Path) -> None:
    heading = np.linspace(-3.1, 3.1, N)
    values = POSES.copy()
    values[:, 5], values[:, 6] = -1.7 * np.sin(heading / 2.0), -1.7 * np.cos(heading / 2.0)
    turned = {"/slider/pose": (POSE, encode(STAMP, values))}
    path = write_mcap(tmp_path / "a.mcap", {**pose_topics(), **turned})
    np.testing.assert_allclose(read_recording(path).slider.heading, heading, atol=1e-14)


def test_every_scalar_type_becomes_a_possible_covariate(tmp_path: Path) -> None:
    value = np.linspace(20.0, 21.0, N)[:, None]
    other = STAMP - 10**9
    with_variance = encode(other, np.column_stack([value, 0.0 * value]), frame_id="sensor")

    def kind(name: str) -> MessageType:
        return MessageType(name, "", "")

    topics: Content = {
        "/float64": (FLOAT64, encode(STAMP, value, header=False)),
        "/float32": (kind("std_msgs/msg/Float32"), [b"\0\1\0\0" + number.tobytes() for number in value.astype("<f4")]),
        "/temperature": (kind("sensor_msgs/msg/Temperature"), with_variance),
        "/humidity": (kind("sensor_msgs/msg/RelativeHumidity"), with_variance),
        "/pressure": (kind("sensor_msgs/msg/FluidPressure"), with_variance),
        "/unused": (FLOAT64, []),
        "/words": (kind("std_msgs/msg/String"), [b"\0\1\0\0\2\0\0\0a\0"]),
    }
    scalars = read_recording(write_mcap(tmp_path / "a.mcap", {**pose_topics(), **topics})).scalars
    assert set(scalars) == {"/float64", "/float32", "/temperature", "/humidity", "/pressure"}
    for name, scalar in scalars.items():
        np.testing.assert_allclose(scalar.value, value[:, 0], rtol=1e-7 if name == "/float32" else 0.0)
        np.testing.assert_array_equal(scalar.stamp, STAMP if "float" in name else other)


def test_missing_rig_is_reported_with_how_to_give_it(tmp_path: Path, recording: Recording) -> None:
    path = write_mcap(tmp_path / "a.mcap", pose_topics())
    with pytest.raises(
        RigError, match=r"no push_rig record; give it with --rig FILE\.yaml or the node parameter 'rig'"
    ):
        require_rig(read_recording(path))
    assert require_rig(read_recording(path, rig=recording.rig)) is recording.rig


@pytest.mark.parametrize("form", ["json", "mapping", "keys"])
def test_rig_is_read_from_custom_data_of_metadata_yaml(tmp_path: Path, recording: Recording, form: str) -> None:
    assert recording.rig is not None
    record = recording.rig.to_record()
    custom = {"json": {"push_rig": json.dumps(record)}, "mapping": {"push_rig": record}, "keys": record}[form]
    write_mcap(tmp_path / "a_0.mcap", pose_topics())
    described = {"storage_identifier": "mcap", "relative_file_paths": ["a_0.mcap"], "custom_data": custom}
    (tmp_path / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": described}))
    assert require_rig(read_recording(tmp_path)).to_record() == record


def test_rig_is_read_from_the_metadata_record_of_rosbag2(tmp_path: Path, recording: Recording) -> None:
    assert recording.rig is not None
    custom = {"custom_data": {"push_rig": json.dumps(recording.rig.to_record())}}
    record = ("rosbag2", {"serialized_metadata": yaml.safe_dump(custom)})
    path = write_mcap(tmp_path / "a.mcap", pose_topics(), metadata=record)
    assert require_rig(read_recording(path)).to_record() == recording.rig.to_record()


def test_rig_of_the_file_takes_precedence_and_a_different_one_is_noted(tmp_path: Path, recording: Recording) -> None:
    write_recording(tmp_path / "a", recording)
    text = (tmp_path / "a" / "metadata.yaml").read_text()
    (tmp_path / "a" / "metadata.yaml").write_text(text.replace("plywood", "delrin"))
    read = read_recording(tmp_path / "a")
    assert require_rig(read).surface == "plywood"
    assert any("push_rig in metadata.yaml differs" in note for note in read.notes)


@pytest.mark.parametrize("text", ["{", "rosbag2_bagfile_information: 3", "other: {}", ""])
def test_damaged_metadata_yaml_is_noted(tmp_path: Path, recording: Recording, text: str) -> None:
    write_recording(tmp_path / "a", recording)
    (tmp_path / "a" / "metadata.yaml").write_text(text)
    read = read_recording(tmp_path / "a")
    assert len(read.slider) == len(recording.slider)
    assert any("metadata.yaml: cannot be read" in note for note in read.notes)
