# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Read a recording: decode the messages of a bag into streams."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path

import numpy as np

from push_predictor.errors import RecordingError, RigError
from push_predictor.recordings.bag.definitions import POSE
from push_predictor.recordings.bag.reader import Bag, open_bag
from push_predictor.recordings.fields.sources import TF_TYPES
from push_predictor.recordings.fields.wrench_bias import WrenchBias
from push_predictor.recordings.rig import HOW_TO_GIVE, RECORD_NAME, Rig, rig_from_record
from push_predictor.recordings.samples import (
    NO_ORIENTATION,
    NOT_FINITE,
    PUSHER,
    SLIDER,
    SPATIAL_WRENCH,
    UNREADABLE,
    WRENCH,
    SampleRules,
    UsableSamples,
    check_samples,
    has_orientation,
    pusher_stream,
    scalar_rules,
    slider_stream,
)
from push_predictor.recordings.select import Messages, select
from push_predictor.recordings.streams import PoseStream, Recording, ScalarStream, WrenchStream
from push_predictor.recordings.topics import WORLD_AXES, Topics, load_topics
from push_predictor.recordings.windows.free_motion import free_motion
from push_predictor.recordings.wrench import WrenchContext, read_wrench

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
    bag, chosen = open_bag(Path(path)), topics.over(load_topics(Path(path)))
    found = select(bag, chosen)
    notes = list(found.notes)
    world = chosen.world or FRAME
    poses = _usable(found.slider, SLIDER, notes, world), _usable(found.pusher, PUSHER, notes, world)
    notes += _different_frames(*poses)
    slider, pusher = slider_stream(poses[0].stamp, poses[0].values), _pusher(poses[1], notes)
    has_tf = any(kind in TF_TYPES for kind in bag.topics.values())
    rig = rig if rig is not None else recorded_rig(bag)
    free = None if rig is None else partial(free_motion, rig, slider, pusher)
    context = WrenchContext(bag.path, has_tf, chosen, *poses, found.tree, found.world, free)
    wrench, bias = _wrench(found.wrench, context, notes)
    scalars = {name: _scalar(messages, notes) for name, messages in found.scalars.items()}
    for messages, stream in ((found.slider, slider), (found.pusher, pusher)):
        if not len(stream):
            raise RecordingError(f"{bag.path}: topic {messages.topic} has no usable sample ({'; '.join(notes)})")
    scalars = {topic: stream for topic, stream in scalars.items() if len(stream)}
    return Recording(bag.name, rig, slider, pusher, wrench, scalars, (*bag.notes, *notes), bias)


def recorded_rig(bag: Bag) -> Rig | None:
    """The rig in a bag's push_rig record, None without a record. Raises RigError for an invalid record."""
    record = bag.metadata.get(RECORD_NAME)
    return None if record is None else rig_from_record(record, str(bag.path))


def require_rig(recording: Recording) -> Rig:
    """The recording's rig. Raises RigError, which states how to give one, if there is none."""
    if recording.rig is None:
        raise RigError(f"{recording.name}: the recording has no {RECORD_NAME} record; {HOW_TO_GIVE}")
    return recording.rig


def _different_frames(slider: UsableSamples, tip: UsableSamples) -> list[str]:
    """A note on poses whose messages name different frames."""
    one, other = ({frame.strip("/") for frame in each.frames} - {""} for each in (slider, tip))
    if one == other or not one or not other:
        return []
    frames = " and ".join(", ".join(map(repr, sorted(each))) for each in (one, other))
    return [f"slider and tip are given in different frames, {frames}; --world-frame turns both into one by tf"]


def _pusher(samples: UsableSamples, notes: list[str]) -> PoseStream:
    if missing := int(np.sum(~has_orientation(samples.values))):
        notes.append(f"{samples.topic}: {missing} samples have no orientation; heading 0 is used")
    return pusher_stream(samples.stamp, samples.values)


def _wrench(
    messages: Messages | None, context: WrenchContext, notes: list[str]
) -> tuple[WrenchStream | None, WrenchBias | None]:
    if messages is None or not messages.data:
        return None, None
    rules = WRENCH if context.topics.wrench_axes == WORLD_AXES else SPATIAL_WRENCH
    return read_wrench(_usable(messages, rules, notes), context, notes)


def _scalar(messages: Messages, notes: list[str]) -> ScalarStream:
    samples = _usable(messages, scalar_rules(messages.type), notes)
    return ScalarStream(samples.stamp, samples.values[:, 0])


def _usable(messages: Messages, rules: SampleRules, notes: list[str], world: str = FRAME) -> UsableSamples:
    """The usable samples; notes report rejected samples and frames of poses."""
    checked = check_samples(messages.data, rules)
    stamp = checked.stamp if rules.layout.header else np.array(messages.log_times, np.uint64).astype(np.int64)
    for kind, count in messages.foreign.items():
        notes.append(f"{messages.topic}: {count} messages have type {kind!r}; discarded")
    for fault, count in checked.rejected.items():
        notes.append(f"{messages.topic}: {count} {FAULTS[fault]}; discarded")
    if messages.type == POSE.name and (frames := checked.frames - {world}):
        notes.append(f"{messages.topic}: frame_id {', '.join(map(repr, sorted(frames)))} is treated as {world!r}")
    return UsableSamples(messages.topic, stamp[checked.usable], checked.values[checked.usable], checked.frames)
