"""Read a recording: decode the messages of a bag into streams."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from push_predictor.errors import RecordingError, RigError
from push_predictor.recordings.bag.definitions import POSE, SCALAR_LAYOUTS
from push_predictor.recordings.bag.definitions import WRENCH as WRENCH_TYPE
from push_predictor.recordings.bag.reader import Bag, open_bag
from push_predictor.recordings.bag.writer import absolute
from push_predictor.recordings.rig import HOW_TO_GIVE, RECORD_NAME, Rig, rig_from_record
from push_predictor.recordings.samples import (
    NO_ORIENTATION,
    NOT_FINITE,
    PUSHER,
    SLIDER,
    UNREADABLE,
    WRENCH,
    SampleRules,
    check_samples,
    has_orientation,
    pusher_stream,
    scalar_rules,
    slider_stream,
    wrench_stream,
)
from push_predictor.recordings.streams import PoseStream, Recording, ScalarStream, WrenchStream
from push_predictor.recordings.topics import TopicNames
from push_predictor.types import Array, IntArray

__all__ = ["TopicNames", "read_recording", "recorded_rig", "require_rig"]

FRAME = "world"
FAULTS = {
    UNREADABLE: "messages are not readable CDR",
    NOT_FINITE: "samples contain NaN or infinity",
    NO_ORIENTATION: "samples have no orientation",
}


def read_recording(
    path: str | os.PathLike[str], *, rig: Rig | None = None, topics: TopicNames = TopicNames()
) -> Recording:
    """Read a .mcap file or a bag folder.

    Streams keep file order. Stamps are header stamps; a scalar without a header has its log time. Samples that
    break a rule of recordings/samples.py are discarded; the notes count them. rig replaces the recorded one.

    Raises RecordingError for a file that is not a recording and for a slider or pusher topic that is missing, empty
    or of another type; RigError for an invalid push_rig record.
    """
    bag = open_bag(Path(path))
    found = _collected(bag, _types(bag, topics))
    notes: list[str] = []
    slider = _slider(found[_named(bag, topics.slider)], notes)
    pusher = _pusher(found[_named(bag, topics.pusher)], notes)
    wrench = _wrench(found.get(_named(bag, topics.wrench)), notes)
    scalars = {topic: _scalar(m, notes) for topic, m in found.items() if m.type in SCALAR_LAYOUTS}
    for topic, stream in ((topics.slider, slider), (topics.pusher, pusher)):
        if not len(stream):
            raise RecordingError(f"{bag.path}: topic {absolute(topic)} has no usable sample ({'; '.join(notes)})")
    rig = rig if rig is not None else recorded_rig(bag)
    scalars = {topic: stream for topic, stream in scalars.items() if len(stream)}
    return Recording(bag.name, rig, slider, pusher, wrench, scalars, (*bag.notes, *notes))


def recorded_rig(bag: Bag) -> Rig | None:
    """The rig in a bag's push_rig record, None without a record. Raises RigError for an invalid record."""
    record = bag.metadata.get(RECORD_NAME)
    return None if record is None else rig_from_record(record, str(bag.path))


def require_rig(recording: Recording) -> Rig:
    """The recording's rig. Raises RigError, which states how to give one, if there is none."""
    if recording.rig is None:
        raise RigError(f"{recording.name}: the recording has no {RECORD_NAME} record; {HOW_TO_GIVE}")
    return recording.rig


@dataclass
class _Messages:
    """The messages of one topic, in file order; foreign counts those of another type, by type."""

    topic: str
    type: str
    log_times: list[int] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)
    foreign: Counter[str] = field(default_factory=Counter)


def _named(bag: Bag, name: str) -> str:
    """The bag's own spelling of a topic's name."""
    return next((topic for topic in bag.topics if topic.strip("/") == name.strip("/")), absolute(name))


def _types(bag: Bag, topics: TopicNames) -> dict[str, str]:
    """{topic: message type} of the topics to read."""
    expected = {
        _named(bag, topics.slider): POSE.name,
        _named(bag, topics.pusher): POSE.name,
        _named(bag, topics.wrench): WRENCH_TYPE.name,
    }
    if missing := [topic for topic, kind in expected.items() if topic not in bag.topics and kind == POSE.name]:
        present = ", ".join(bag.topics) or "no topic"
        raise RecordingError(f"{bag.path}: no topic {' and '.join(missing)} of {POSE.name}; it contains {present}")
    scalars = {topic: kind for topic, kind in bag.topics.items() if kind in SCALAR_LAYOUTS}
    return {topic: kind for topic, kind in {**scalars, **expected}.items() if topic in bag.topics}


def _collected(bag: Bag, types: dict[str, str]) -> dict[str, _Messages]:
    found = {topic: _Messages(topic, kind) for topic, kind in types.items()}
    for topic, kind, log_time, data in bag.messages(found):
        messages = found[topic]
        if kind != messages.type:
            messages.foreign[kind] += 1
            continue
        messages.log_times.append(log_time)
        messages.data.append(data)
    for messages in found.values():
        _check_found(bag, messages)
    return found


def _check_found(bag: Bag, messages: _Messages) -> None:
    topic, kind = messages.topic, next(iter(messages.foreign), "")
    if messages.foreign and not messages.data:
        raise RecordingError(f"{bag.path}: topic {topic} is of type {kind!r}, {messages.type} is accepted")
    if messages.type == POSE.name and not messages.data:
        known = "".join(f"; {note}" for note in bag.notes[:3])
        raise RecordingError(f"{bag.path}: topic {topic} contains no readable message{known}")


def _slider(messages: _Messages, notes: list[str]) -> PoseStream:
    return slider_stream(*_usable(messages, SLIDER, notes))


def _pusher(messages: _Messages, notes: list[str]) -> PoseStream:
    stamp, values = _usable(messages, PUSHER, notes)
    if missing := int(np.sum(~has_orientation(values))):
        notes.append(f"{messages.topic}: {missing} samples have no orientation; heading 0 is used")
    return pusher_stream(stamp, values)


def _wrench(messages: _Messages | None, notes: list[str]) -> WrenchStream | None:
    if messages is None or not messages.data:
        return None
    return wrench_stream(*_usable(messages, WRENCH, notes))


def _scalar(messages: _Messages, notes: list[str]) -> ScalarStream:
    stamp, values = _usable(messages, scalar_rules(messages.type), notes)
    return ScalarStream(stamp, values[:, 0])


def _usable(messages: _Messages, rules: SampleRules, notes: list[str]) -> tuple[IntArray, Array]:
    """Stamps (n,) and numbers (n, k) of the usable samples; notes report rejected samples and other frames."""
    checked = check_samples(messages.data, rules)
    stamp = checked.stamp if rules.layout.header else np.array(messages.log_times, np.uint64).astype(np.int64)
    for kind, count in messages.foreign.items():
        notes.append(f"{messages.topic}: {count} messages have type {kind!r}; discarded")
    for fault, count in checked.rejected.items():
        notes.append(f"{messages.topic}: {count} {FAULTS[fault]}; discarded")
    if messages.type in (POSE.name, WRENCH_TYPE.name) and (frames := checked.frames - {FRAME}):
        notes.append(f"{messages.topic}: frame_id {', '.join(map(repr, sorted(frames)))} is treated as {FRAME!r}")
    return stamp[checked.usable], checked.values[checked.usable]
