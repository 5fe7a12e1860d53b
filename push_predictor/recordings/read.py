"""Read a recording: the bag's messages decoded, column by column, into streams."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from push_predictor.errors import RecordingError, RigError
from push_predictor.geometry.frames import yaw_of_quaternion
from push_predictor.recordings.bag.cdr import POSE_STAMPED, WRENCH_STAMPED, Columns, Layout, decode
from push_predictor.recordings.bag.definitions import POSE, SCALAR_LAYOUTS, WRENCH
from push_predictor.recordings.bag.reader import Bag, open_bag
from push_predictor.recordings.bag.writer import absolute
from push_predictor.recordings.rig import HOW_TO_GIVE, RECORD_NAME, Rig, rig_from_record
from push_predictor.recordings.streams import PoseStream, Recording, ScalarStream, WrenchStream
from push_predictor.recordings.topics import TopicNames
from push_predictor.types import Array, BoolArray, IntArray

__all__ = ["TopicNames", "read_recording", "recorded_rig", "require_rig"]

FRAME = "world"
SMALLEST_COMPONENT = 1e-6  # a quaternion with no component above this tells no heading


def read_recording(path: Path, *, rig: Rig | None = None, topics: TopicNames = TopicNames()) -> Recording:
    """Read a .mcap file or a bag folder.

    Streams keep file order; stamps are header stamps, of scalars without a header the log time. Samples that are
    not finite or cannot be decoded are dropped; notes tell how many. rig takes the place of the recorded one.

    Raises RecordingError for a file that is no recording, for a missing or empty slider or pusher topic and for one
    of another type; RigError for a push_rig record that is wrong.
    """
    bag = open_bag(Path(path))
    layouts = _layouts(bag, topics)
    found = _collected(bag, layouts)
    notes: list[str] = []
    slider = _slider(found[_named(bag, topics.slider)], notes)
    pusher = _pusher(found[_named(bag, topics.pusher)], notes)
    wrench = _wrench(found.get(_named(bag, topics.wrench)), notes)
    scalars = {topic: _scalar(s, notes) for topic, s in found.items() if s.type in SCALAR_LAYOUTS}
    for topic, stream in ((topics.slider, slider), (topics.pusher, pusher)):
        if not len(stream):
            raise RecordingError(f"{bag.path}: topic {absolute(topic)} has no usable sample ({'; '.join(notes)})")
    rig = rig if rig is not None else recorded_rig(bag)
    return Recording(bag.name, rig, slider, pusher, wrench, _with_samples(scalars), (*bag.notes, *notes))


def recorded_rig(bag: Bag) -> Rig | None:
    """The rig of a bag's push_rig record, None where it has none. Raises RigError if the record is wrong."""
    record = bag.metadata.get(RECORD_NAME)
    return None if record is None else rig_from_record(record, str(bag.path))


def require_rig(recording: Recording) -> Rig:
    """The recording's rig. Raises RigError that tells how to give it."""
    if recording.rig is None:
        raise RigError(f"{recording.name}: the recording has no {RECORD_NAME} record; {HOW_TO_GIVE}")
    return recording.rig


@dataclass
class _Samples:
    """The messages of one topic, in file order."""

    topic: str
    type: str
    layout: Layout
    log_times: list[int] = field(default_factory=list)
    messages: list[bytes] = field(default_factory=list)
    foreign: Counter[str] = field(default_factory=Counter)  # of other types, by type


def _named(bag: Bag, name: str) -> str:
    """The bag's own spelling of a topic's name."""
    return next((topic for topic in bag.topics if topic.strip("/") == name.strip("/")), absolute(name))


def _layouts(bag: Bag, topics: TopicNames) -> dict[str, tuple[str, Layout]]:
    """{topic: (type, layout)} of the topics to read."""
    expected = {
        _named(bag, topics.slider): (POSE.name, POSE_STAMPED),
        _named(bag, topics.pusher): (POSE.name, POSE_STAMPED),
        _named(bag, topics.wrench): (WRENCH.name, WRENCH_STAMPED),
    }
    if missing := [t for t, (kind, _) in expected.items() if t not in bag.topics and kind == POSE.name]:
        there = ", ".join(bag.topics) or "no topic"
        raise RecordingError(f"{bag.path}: no topic {' and '.join(missing)} of {POSE.name}, it holds {there}")
    scalars = {topic: (kind, SCALAR_LAYOUTS[kind]) for topic, kind in bag.topics.items() if kind in SCALAR_LAYOUTS}
    return {topic: what for topic, what in {**scalars, **expected}.items() if topic in bag.topics}


def _collected(bag: Bag, layouts: dict[str, tuple[str, Layout]]) -> dict[str, _Samples]:
    found = {topic: _Samples(topic, kind, layout) for topic, (kind, layout) in layouts.items()}
    for topic, kind, log_time, data in bag.messages(found):
        samples = found[topic]
        if kind != samples.type:
            samples.foreign[kind] += 1
            continue
        samples.log_times.append(log_time)
        samples.messages.append(data)
    for samples in found.values():
        _check_found(bag, samples)
    return found


def _check_found(bag: Bag, samples: _Samples) -> None:
    topic, kind = samples.topic, next(iter(samples.foreign), "")
    if samples.foreign and not samples.messages:
        raise RecordingError(f"{bag.path}: topic {topic} is of type {kind!r}, {samples.type} is accepted")
    if samples.type == POSE.name and not samples.messages:
        known = "".join(f"; {note}" for note in bag.notes[:3])
        raise RecordingError(f"{bag.path}: topic {topic} holds no message that can be read{known}")


def _slider(samples: _Samples, notes: list[str]) -> PoseStream:
    columns = decode(samples.messages, samples.layout)
    finite = _finite(columns.values)
    kept = _kept(samples, columns, finite & _turned(columns.values), notes)
    values = columns.values[kept]
    return _poses(columns.stamp[kept], values, _heading(values))


def _pusher(samples: _Samples, notes: list[str]) -> PoseStream:
    """A tip is a point: one that comes without an orientation is as good."""
    columns = decode(samples.messages, samples.layout)
    finite = _finite(columns.values[:, :3])
    kept = _kept(samples, columns, finite, notes)
    values = columns.values[kept]
    turned = _turned(values)
    if not turned.all():
        notes.append(f"{samples.topic}: {np.sum(~turned)} samples have no orientation, heading 0 was taken")
    values[~turned, 3:] = 0.0, 0.0, 0.0, 1.0
    return _poses(columns.stamp[kept], values, _heading(values))


def _wrench(samples: _Samples | None, notes: list[str]) -> WrenchStream | None:
    if samples is None or not samples.messages:
        return None
    columns = decode(samples.messages, samples.layout)
    fx, fy, torque = columns.values[:, (0, 1, 5)].T
    kept = _kept(samples, columns, np.isfinite(fx) & np.isfinite(fy) & np.isfinite(torque), notes)
    return WrenchStream(columns.stamp[kept], fx[kept], fy[kept], torque[kept])


def _scalar(samples: _Samples, notes: list[str]) -> ScalarStream:
    columns = decode(samples.messages, samples.layout)
    stamp = columns.stamp if samples.layout.header else np.array(samples.log_times, np.uint64).astype(np.int64)
    value = columns.values[:, 0]
    kept = _kept(samples, columns, np.isfinite(value), notes)
    return ScalarStream(stamp[kept], value[kept])


def _with_samples(scalars: dict[str, ScalarStream]) -> dict[str, ScalarStream]:
    return {topic: stream for topic, stream in scalars.items() if len(stream)}


def _kept(samples: _Samples, columns: Columns, usable: BoolArray, notes: list[str]) -> BoolArray:
    """Which samples stay; notes tell what was dropped and whose frame is another one."""
    for kind, count in samples.foreign.items():
        notes.append(f"{samples.topic}: {count} messages are of type {kind!r}, they were dropped")
    if unreadable := int(np.sum(~columns.valid)):
        notes.append(f"{samples.topic}: {unreadable} messages are not readable CDR and were dropped")
    if useless := int(np.sum(columns.valid & ~usable)):
        notes.append(f"{samples.topic}: {useless} samples are not finite (or have no orientation), dropped")
    if samples.type in (POSE.name, WRENCH.name) and (frames := columns.frames - {FRAME}):
        notes.append(f"{samples.topic}: frame_id {', '.join(map(repr, sorted(frames)))}, taken for {FRAME!r}")
    return columns.valid & usable


def _finite(values: Array) -> BoolArray:
    return np.asarray(np.isfinite(values).all(axis=1))


def _turned(values: Array) -> BoolArray:
    """Which poses have an orientation at all."""
    largest = np.abs(values[:, 3:]).max(axis=1)
    return np.isfinite(largest) & (largest > SMALLEST_COMPONENT)


def _heading(values: Array) -> Array:
    quaternion = values[:, 3:] / np.abs(values[:, 3:]).max(axis=1, keepdims=True)
    unit = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    return yaw_of_quaternion(*unit.T)


def _poses(stamp: IntArray, values: Array, heading: Array) -> PoseStream:
    x, y, z = values[:, :3].T.copy()
    return PoseStream(stamp, x, y, z, heading)
