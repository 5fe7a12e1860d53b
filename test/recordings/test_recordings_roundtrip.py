# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A written recording reads back with the same streams, for any content and compression."""

from __future__ import annotations

import tempfile
from pathlib import Path

import hypothesis.extra.numpy as arrays
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from push_predictor.recordings.bag.message_types import POSE
from push_predictor.recordings.bag.messages import Messages, encode
from push_predictor.recordings.fields.sources import POSE_TARGET, Columns, FieldReader, definitions_of
from push_predictor.recordings.read import read_recording
from push_predictor.recordings.streams import PoseStream, Recording, ScalarStream, WrenchStream
from push_predictor.recordings.write import write_recording

FINITE = st.floats(allow_nan=False, allow_infinity=False)
STAMP = st.integers(0, 2_000_000_000 * 10**9)
COMPRESSIONS = ("zstd", "lz4", "none")


def columns(count: int, n: int, elements: st.SearchStrategy[float] = FINITE) -> st.SearchStrategy[np.ndarray]:
    return arrays.arrays(np.float64, (count, n), elements=elements)


@st.composite
def stamps(draw: st.DrawFn, least: int = 1) -> np.ndarray:
    return np.array(draw(st.lists(STAMP, min_size=least, max_size=12)), dtype=np.int64)


@st.composite
def poses(draw: st.DrawFn) -> PoseStream:
    stamp = draw(stamps())
    headings = st.floats(-10.0, 10.0)
    return PoseStream(stamp, *draw(columns(3, len(stamp))), *draw(columns(1, len(stamp), headings)))


@st.composite
def wrenches(draw: st.DrawFn) -> WrenchStream:
    stamp = draw(stamps())
    return WrenchStream(stamp, *draw(columns(3, len(stamp))))


@st.composite
def scalars(draw: st.DrawFn, stamp: np.ndarray | None = None) -> ScalarStream:
    stamp = draw(stamps()) if stamp is None else stamp
    return ScalarStream(stamp, *draw(columns(1, len(stamp))))


@st.composite
def recordings(draw: st.DrawFn) -> Recording:
    """A scalar over an hour from the poses would be of another clock."""
    slider, pusher, wrench = draw(poses()), draw(poses()), draw(st.none() | wrenches())
    names = st.sampled_from(["/room/temperature", "/belt", "/a/b/c"])
    found = draw(st.dictionaries(names, scalars(pusher.stamp), max_size=2))
    return Recording("any", None, slider, pusher, wrench, found)


def assert_same_pose(read: PoseStream, written: PoseStream) -> None:
    for name in ("stamp", "x", "y", "z"):
        np.testing.assert_array_equal(getattr(read, name), getattr(written, name), err_msg=name)
    turn = read.heading - written.heading
    np.testing.assert_allclose(np.cos(turn), 1.0, atol=1e-14)
    np.testing.assert_allclose(np.sin(turn), 0.0, atol=1e-13)


@settings(max_examples=20, deadline=None)
@given(recordings(), st.sampled_from(COMPRESSIONS), st.booleans())
def test_any_recording_reads_back_unchanged(written: Recording, compression: str, bare: bool) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / ("any.mcap" if bare else "any")
        write_recording(path, written, compression=compression)
        read = read_recording(path)
    assert (read.name, read.rig, read.notes) == ("any", None, ())
    assert_same_pose(read.slider, written.slider)
    assert_same_pose(read.pusher, written.pusher)
    assert (read.wrench is None) == (written.wrench is None)
    if read.wrench is not None and written.wrench is not None:
        for name in ("stamp", "fx", "fy", "torque"):
            np.testing.assert_array_equal(getattr(read.wrench, name), getattr(written.wrench, name), err_msg=name)
    assert set(read.scalars) == set(written.scalars)


@pytest.mark.parametrize("name", ["push", "push.mcap"])
def test_same_recording_gives_the_same_bytes(recording: Recording, tmp_path: Path, name: str) -> None:
    for folder in ("first", "second"):
        write_recording(tmp_path / folder / name, recording)
    first, second = ([p for p in sorted((tmp_path / k).rglob("*")) if p.is_file()] for k in ("first", "second"))
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]
    assert [p.name for p in first] == (["metadata.yaml", "push_0.mcap"] if name == "push" else ["push.mcap"])


def decoded(messages: list[bytes]) -> Columns:
    """Poses as the reader of fields decodes them."""
    reader = FieldReader(POSE_TARGET, POSE.name, "pose", definitions_of(POSE.name, {}))
    return reader.read(Messages.of("/slider/pose", POSE.name, np.zeros(len(messages), np.int64), messages))


@given(stamps(0), st.text(max_size=20), st.data())
def test_columns_read_back_from_cdr_with_any_frame_id(stamp: np.ndarray, frame: str, data: st.DataObject) -> None:
    frame = frame.replace("\0", "")
    values = data.draw(columns(len(stamp), 7, st.floats()))
    found = decoded(encode(stamp, values, frame_id=frame))
    np.testing.assert_array_equal(found.values, values)
    np.testing.assert_array_equal(found.stamp, stamp)
    assert found.valid.all()
    assert found.named == (frozenset({frame.strip("/")}) if len(stamp) else frozenset())


def test_messages_of_different_frames_lengths_and_byte_orders_keep_their_order() -> None:
    stamp, values = np.arange(6, dtype=np.int64) * 10**9 + 5, np.arange(42.0).reshape(6, 7)
    frames = ["", "w", "world", "a_long_frame_name", "world", "w"]
    messages = [encode(stamp[i : i + 1], values[i : i + 1], frame_id=frames[i])[0] for i in range(6)]
    messages[2] = big_endian(messages[2], len("world") + 1)
    messages[4] = messages[4][:-9]
    found = decoded(messages)
    assert found.valid.tolist() == [True, True, True, True, False, True]
    np.testing.assert_array_equal(found.values[found.valid], values[found.valid])
    np.testing.assert_array_equal(found.stamp[found.valid], stamp[found.valid])


def big_endian(message: bytes, frame_length: int) -> bytes:
    """The same message in the other byte order."""
    start = len(message) - 7 * 8
    words = np.frombuffer(message[4:16], "<u4").astype(">u4").tobytes()
    numbers = np.frombuffer(message[start:], "<f8").astype(">f8").tobytes()
    return b"\0\0\0\0" + words + message[16:start] + numbers
