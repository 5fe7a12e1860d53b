# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Read a recording: the messages of a bag, decoded into streams."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

from push_predictor.errors import RecordingError, RigError
from push_predictor.recordings.bag.message_types import POSE
from push_predictor.recordings.bag.messages import Notes
from push_predictor.recordings.bag.reader import Bag, open_bag
from push_predictor.recordings.decoder.decoder import StreamDecoder, name_of
from push_predictor.recordings.decoder.rules import (
    NO_ELEMENT,
    NO_ORIENTATION,
    NO_TRANSFORM,
    NOT_FINITE,
    OTHER_CLOCK,
    UNREADABLE,
)
from push_predictor.recordings.decoder.sources import COVARIATE, POSES, STATIC, STREAMS, scalar_source, sources_of
from push_predictor.recordings.decoder.topic_input import TopicInput
from push_predictor.recordings.decoder.wrench import WrenchInput
from push_predictor.recordings.fields.sources import POSE_TARGET, SCALAR_FIELDS, TF_TYPES, Source
from push_predictor.recordings.fields.transforms import WORLD
from push_predictor.recordings.rig import HOW_TO_GIVE, RECORD_NAME, Rig, rig_from_record
from push_predictor.recordings.streams import Recording, WrenchStream
from push_predictor.recordings.topics import NO_BIAS, NO_WRENCH, TIP_AXES, WORLD_AXES, Topics, load_topics
from push_predictor.recordings.untyped_topics import tell_types

__all__ = ["Topics", "read_recording", "recorded_rig", "require_rig"]

STATED = 3  # losses that an error states
FAULTS = {
    NO_ELEMENT: "messages lack the chosen element, or their matrix is no pose",
    UNREADABLE: "messages are not readable CDR",
    NOT_FINITE: "samples contain NaN or infinity",
    NO_ORIENTATION: "samples have no orientation",
    OTHER_CLOCK: "samples have a stamp over an hour from those of the poses",
    NO_TRANSFORM: "samples outside the time, or in a dropout, of a transform",
}


def read_recording(path: str | os.PathLike[str], *, rig: Rig | None = None, topics: Topics = Topics()) -> Recording:
    """Read a .mcap file or a bag folder.

    topics: where the streams are; those not given are read from NAME.recording.yaml, else have their default. Streams
    keep file order. Stamps are header stamps; a scalar without a header has its log time. Samples that break a rule of
    decoder/rules.py are discarded; the notes count them. rig replaces the recorded one.

    Raises RecordingError for a file that is not a recording, and for a topic that is missing, empty or of a type that
    does not fit, with the option, its value and what the bag contains; RigError for an invalid push_rig record;
    RequestError if slider and pusher come from one place.
    """
    bag, chosen = open_bag(Path(path)), topics.over(load_topics(Path(path)))
    rig = rig if rig is not None else recorded_rig(bag)
    try:
        return _read(bag, rig, chosen)
    except RecordingError as error:  # what is lost may be the cause
        losses = [loss for loss in bag.notes.losses if loss not in str(error)]
        raise RecordingError("; ".join([str(error), *losses[:STATED]])) from None


def _read(bag: Bag, rig: Rig | None, chosen: Topics) -> Recording:
    notes = Notes()
    if rig is None and chosen.wrench_bias not in ("", NO_BIAS):
        notes.add("the bias of the wrench is not subtracted: free motion is found with a rig, and there is none")
        chosen = replace(chosen, wrench_bias="")
    decoder = StreamDecoder(chosen)
    if rig is not None:
        decoder.begin(rig)
    for messages in bag.portions(_declared(bag, chosen, decoder, notes)):
        decoder.put(messages)
    samples = decoder.take(last=True)
    _note_poses(bag, decoder, notes)
    wrench = _wrench(bag, decoder, samples.wrench, notes)
    for name, each in decoder.scalars.items():
        _note_rejected(notes, _spelling(bag, name), each.rejected, each.foreign)
    for name, stream in (("slider", samples.slider), ("pusher", samples.pusher)):
        if not len(stream):
            own = decoder.of(name)
            label, names = _label(bag, own.source), own.names if isinstance(own, TopicInput) else []
            there = f". The elements are named {', '.join(map(repr, names))}" if names else ""
            raise RecordingError(f"{bag.path}: topic {label} has no usable sample ({'; '.join(notes)}){there}")
    scalars = {_spelling(bag, name): stream for name, stream in samples.scalars.items() if len(stream)}
    every = bag.notes
    every.add_all(notes)
    return Recording(
        bag.name,
        rig,
        samples.slider,
        samples.pusher,
        wrench,
        scalars,
        tuple(every),
        decoder.wrench.estimate,
        tuple(every.losses),
    )


def recorded_rig(bag: Bag) -> Rig | None:
    """The rig in a bag's push_rig record, None without a record. Raises RigError for an invalid record."""
    record = bag.metadata.get(RECORD_NAME)
    return None if record is None else rig_from_record(record, str(bag.path))


def require_rig(recording: Recording) -> Rig:
    """The recording's rig. Raises RigError, which states how to give one, if there is none."""
    if recording.rig is None:
        raise RigError(f"{recording.name}: the recording has no {RECORD_NAME} record; {HOW_TO_GIVE}")
    return recording.rig


# --- topics ----------------------------------------------------------------------------------------------------------


def _declared(bag: Bag, topics: Topics, decoder: StreamDecoder, notes: Notes) -> set[str]:
    """Declare the types of all topics to the decoder; returns the topics to read. Raises RecordingError."""
    every = sources_of(topics)
    named = {name: source for name, source in every if name in STREAMS}
    given = {name for name in named if getattr(topics, name)} - ({"wrench"} if topics.wrench == NO_WRENCH else set())
    further = [source for name, source in every if name == COVARIATE]
    _check_present(bag, named, given, further)
    tell_types(bag, topics, decoder.tf, notes)
    read = {bag.spelled(source.topic) for source in further}
    for name, source in named.items():
        if (name, source.text) == ("wrench", NO_WRENCH) or not (kind := _kind(bag, name, source, name in given)):
            continue
        read.add(bag.spelled(source.topic))
        if not source.frame:
            decoder.inputs()[name].declare(kind, bag.schemas, bag.path)
    for source in further:
        decoder.scalars[name_of(source)].declare(bag.topics[bag.spelled(source.topic)], bag.schemas, bag.path)
    for topic, kind in bag.topics.items():  # the others that contain one number
        if kind in SCALAR_FIELDS and name_of(scalar_source(topic)) not in decoder.scalars:
            decoder.add_scalar(scalar_source(topic)).declare(kind, bag.schemas, bag.path)
            read.add(topic)
    both = {name for topic in decoder.tf for name in (bag.spelled(topic), bag.spelled(topic) + STATIC)}
    return read | {name for name in both if bag.topics.get(name) in TF_TYPES}


def _kind(bag: Bag, name: str, source: Source, given: bool) -> str:
    """The type to read from a source's topic, '' without the topic."""
    kind, target = bag.topics.get(bag.spelled(source.topic), ""), STREAMS[name]
    source.check_type(kind, bag.path)
    return kind if given or kind in target.known or not kind else target.type


def _check_present(bag: Bag, named: Mapping[str, Source], given: Collection[str], further: list[Source]) -> None:
    """Raise RecordingError for a missing topic, with the topics of the bag and their types."""
    present = ", ".join(f"{topic} ({kind})" for topic, kind in bag.topics.items()) or "no topic"
    for source in [*(named[name] for name in named if name in given), *further]:
        if bag.spelled(source.topic) not in bag.topics:
            raise source.error(bag.path, f"no such topic; the bag contains {present}")
    poses = [source for name, source in named.items() if name not in given and STREAMS[name] is POSE_TARGET]
    missing = [(bag.spelled(source.topic), source.option) for source in poses]
    if missing := [(topic, option) for topic, option in missing if topic not in bag.topics]:
        names, options = (" and ".join(each) for each in zip(*missing, strict=True))
        raise RecordingError(f"{bag.path}: no topic {names} of {POSE.name}; it contains {present}; give {options}")


def _spelling(bag: Bag, name: str) -> str:
    """The name of a scalar with the bag's own spelling of its topic."""
    topic, dot, field = name.partition(".")
    return bag.spelled(topic) + dot + field


def _label(bag: Bag, source: Source) -> str:
    """The name of a source in notes."""
    return bag.spelled(source.topic) + source.text[len(source.topic) :]


# --- notes -----------------------------------------------------------------------------------------------------------


def _note_poses(bag: Bag, decoder: StreamDecoder, notes: Notes) -> None:
    """Note what was discarded and assumed. Raises RecordingError for a stream without a readable message or a frame."""
    world = decoder.world or WORLD
    for buffer_topic, buffer in decoder.tf.items():
        if buffer.unreadable:
            _note_rejected(notes, bag.spelled(buffer_topic), {UNREADABLE: buffer.unreadable}, {})
    for name in POSES:
        own, problem = decoder.of(name), decoder.problem(name)
        label, turned, frames = _label(bag, own.source), "", frozenset[str]()
        if isinstance(own, TopicInput):
            _check_read(bag, label, own)
            turned = f"; the frame of the poses is turned into world_frame {world!r} (option --world-frame)"
            frames = frozenset() if decoder.topics.world else own.named - {world}
        elif own.lacks_world and decoder.topics.world:
            raise Source("world_frame", world).error(bag.path, problem)
        if problem:
            raise own.source.error(bag.path, problem + turned)
        _note_rejected(notes, label, own.rejected, own.foreign)
        if frames:
            notes.add(f"{label}: frame_id {', '.join(map(repr, sorted(frames)))} is treated as {world!r}")
    if decoder.headless:
        label = _label(bag, decoder.of("pusher").source)
        notes.add(f"{label}: {decoder.headless} samples have no orientation; heading 0 is used")
    one, other = (decoder.of(name).named - {""} for name in POSES)
    if one != other and one and other and not decoder.topics.world:
        both = " and ".join(", ".join(map(repr, sorted(each))) for each in (one, other))
        notes.add(f"slider and tip are given in different frames, {both}; --world-frame turns both into one by tf")


def _check_read(bag: Bag, label: str, messages: TopicInput) -> None:
    if messages.foreign and not messages.received:
        kind = next(iter(messages.foreign))
        raise RecordingError(f"{bag.path}: topic {label} is of type {kind!r}, {messages.kind} is accepted")
    if not messages.received:
        known = "".join(f"; {note}" for note in bag.notes[:3])
        raise RecordingError(f"{bag.path}: topic {label} contains no readable message{known}")


def _note_rejected(notes: Notes, label: str, rejected: Mapping[str, int], foreign: Mapping[str, int]) -> None:
    """Note the messages that were discarded; those that a tracker has marked as invalid are no loss."""
    for kind, count in foreign.items():
        notes.add(f"{label}: {count} messages have type {kind!r}; discarded", lost=True)
    for fault, count in rejected.items():
        notes.add(f"{label}: {count} {FAULTS[fault]}; discarded", lost=fault in (UNREADABLE, OTHER_CLOCK))


def _wrench(bag: Bag, decoder: StreamDecoder, found: WrenchStream, notes: Notes) -> WrenchStream | None:
    """The stream, None without any message; notes state what was assumed. Raises RecordingError."""
    wrench, topics = decoder.wrench, decoder.topics
    label = bag.spelled(wrench.messages.source.topic)
    _note_rejected(notes, label, wrench.messages.rejected, wrench.messages.foreign)
    if not wrench.messages.received:
        if bag.topics.get(label) and topics.wrench != NO_WRENCH and not wrench.messages.foreign:
            notes.add(f"{label} contains no readable message: contact is found from the geometry alone", lost=True)
        return None
    turned = topics.wrench_axes != WORLD_AXES
    for text in _turned(bag, wrench, label, decoder) if turned else _unexpected_frame(bag, decoder, label):
        notes.add(text)
    if wrench.bias is not None:
        if wrench.bias.estimate is None:
            problem = wrench.bias.problem or "there is no wrench"
            raise Source("wrench_bias", topics.wrench_bias).error(bag.path, f"{problem}, or give {NO_BIAS}")
        notes.add(f"{label}: subtracted {wrench.bias.estimate.to_text()}")
    return found


def _turned(bag: Bag, wrench: WrenchInput, label: str, decoder: StreamDecoder) -> list[str]:
    """Notes on a wrench whose axes are turned. Raises RecordingError if they cannot be."""
    given, tip = Source("wrench_frame", decoder.topics.wrench_frame), _label(bag, decoder.of("pusher").source)
    found = [f"the axes of the wrench are turned with the tip ({tip})"]
    if wrench.frame:
        if not any(kind in TF_TYPES for kind in bag.topics.values()):
            problem = f"the bag has no /tf; give {TIP_AXES} or {WORLD_AXES}, or record /tf and /tf_static"
            raise given.error(bag.path, problem)
        if wrench.problem:
            problem = f"{wrench.problem}; {TIP_AXES} and {WORLD_AXES} are accepted as well"
            raise given.error(bag.path, problem)
        into = wrench.turned_into
        found = [
            f"the axes of the wrench are turned from {wrench.frame!r} to {into!r} by tf, its torque is moved to the tip"
        ]
    elif not wrench.oriented:
        problem = f"the poses of {tip} have no orientation; give {WORLD_AXES} or a frame in /tf"
        raise given.error(bag.path, problem)
    if without := wrench.without_pose:
        found.append(f"{label}: {without} samples outside the time, or in a dropout, of their frame; discarded")
    return found


def _unexpected_frame(bag: Bag, decoder: StreamDecoder, label: str) -> list[str]:
    """A note on a wrench in a frame that is not that of the poses, none if the axes were given or are the poses'."""
    world = decoder.world or WORLD
    others = sorted(decoder.wrench.messages.named - {world, *decoder.named})
    if not others or decoder.topics.wrench_frame:
        return []
    has_tf = any(kind in TF_TYPES for kind in bag.topics.values())
    by_tf = f"--wrench-frame {others[-1] or 'FRAME'} turns the axes by tf" if has_tf else "the bag has no /tf"
    return [
        f"{label}: frame_id {', '.join(map(repr, others))} is treated as {world!r}; {by_tf}, "
        f"--wrench-frame {TIP_AXES} turns them with the tip, --wrench-frame {WORLD_AXES} confirms them"
    ]
