"""Read a recording: decode the messages of a bag into streams."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from push_predictor.errors import RecordingError, RigError
from push_predictor.recordings.bag.definitions import POSE
from push_predictor.recordings.bag.definitions import WRENCH as WRENCH_TYPE
from push_predictor.recordings.bag.reader import Bag, open_bag
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
from push_predictor.recordings.select import Messages, select
from push_predictor.recordings.streams import PoseStream, Recording, ScalarStream, WrenchStream
from push_predictor.recordings.topics import Topics, load_topics
from push_predictor.types import Array, IntArray

__all__ = ["Topics", "read_recording", "recorded_rig", "require_rig"]

FRAME = "world"
FAULTS = {
    UNREADABLE: "messages are not readable CDR",
    NOT_FINITE: "samples contain NaN or infinity",
    NO_ORIENTATION: "samples have no orientation",
}


def read_recording(path: str | os.PathLike[str], *, rig: Rig | None = None, topics: Topics = Topics()) -> Recording:
    """Read a .mcap file or a bag folder.

    topics: where the streams are; those not given are read from NAME.recording.yaml, else have their default. Streams
    keep file order. Stamps are header stamps; a scalar without a header has its log time. Samples that break a rule of
    recordings/samples.py are discarded; the notes count them. rig replaces the recorded one.

    Raises RecordingError for a file that is not a recording, and for a topic that is missing, empty or of a type that
    does not fit, with the option, its value and what the bag contains; RigError for an invalid push_rig record.
    """
    bag = open_bag(Path(path))
    found = select(bag, topics.over(load_topics(Path(path))))
    notes = list(found.notes)
    slider, pusher = _slider(found.slider, notes), _pusher(found.pusher, notes)
    wrench = _wrench(found.wrench, notes)
    scalars = {name: _scalar(messages, notes) for name, messages in found.scalars.items()}
    for messages, stream in ((found.slider, slider), (found.pusher, pusher)):
        if not len(stream):
            raise RecordingError(f"{bag.path}: topic {messages.topic} has no usable sample ({'; '.join(notes)})")
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


def _slider(messages: Messages, notes: list[str]) -> PoseStream:
    return slider_stream(*_usable(messages, SLIDER, notes))


def _pusher(messages: Messages, notes: list[str]) -> PoseStream:
    stamp, values = _usable(messages, PUSHER, notes)
    if missing := int(np.sum(~has_orientation(values))):
        notes.append(f"{messages.topic}: {missing} samples have no orientation; heading 0 is used")
    return pusher_stream(stamp, values)


def _wrench(messages: Messages | None, notes: list[str]) -> WrenchStream | None:
    if messages is None or not messages.data:
        return None
    return wrench_stream(*_usable(messages, WRENCH, notes))


def _scalar(messages: Messages, notes: list[str]) -> ScalarStream:
    stamp, values = _usable(messages, scalar_rules(messages.type), notes)
    return ScalarStream(stamp, values[:, 0])


def _usable(messages: Messages, rules: SampleRules, notes: list[str]) -> tuple[IntArray, Array]:
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
