# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The messages of a bag that the streams of a recording are read from, in the types of a recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.cdr import POSE_STAMPED, encode
from push_predictor.recordings.bag.definitions import POSE, SCALAR_LAYOUTS
from push_predictor.recordings.bag.reader import Bag
from push_predictor.recordings.bag.writer import absolute
from push_predictor.recordings.fields.sources import (
    POSE_TARGET,
    SCALAR_TARGET,
    TF_TYPES,
    WRENCH_TARGET,
    Source,
    Target,
    definitions_of,
    field_to_read,
    messages_as,
)
from push_predictor.recordings.fields.transforms import TransformError, TransformTree, read_tree
from push_predictor.recordings.fields.world_frame import poses_in_world
from push_predictor.recordings.topics import DEFAULT_TOPICS, NO_WRENCH, Topics

TF, STATIC = "/tf", "_static"  # /tf_static belongs to /tf
STREAMS = {"slider": POSE_TARGET, "pusher": POSE_TARGET, "wrench": WRENCH_TARGET}


@dataclass
class Messages:
    """The messages of one topic, in file order; foreign counts those of another type, by type."""

    topic: str
    type: str
    log_times: list[int] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)
    foreign: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True)
class Selection:
    """The messages of each stream. scalars: by topic name, or topic and field. notes: what was assumed on the way.

    tree: the frames of tf where a stream needs them; world: the frame of poses from tf, '' without any.
    """

    slider: Messages
    pusher: Messages
    wrench: Messages | None
    scalars: dict[str, Messages]
    notes: tuple[str, ...]
    tree: TransformTree | None = None
    world: str = ""


def select(bag: Bag, topics: Topics) -> Selection:
    """Read the messages of the topics, and convert other types to those of a recording.

    Raises RecordingError for a topic that is missing, empty, or of a type that does not fit.
    """
    every = topics.over(DEFAULT_TOPICS)
    wanted = [name for name in STREAMS if (name, getattr(every, name)) != ("wrench", NO_WRENCH)]
    named = {name: Source(f"{name}_topic", f"--{name}-topic", getattr(every, name)) for name in wanted}
    given = {name for name in wanted if getattr(topics, name)}
    further = [Source("covariate_topics", "--covariate-topic", text) for text in topics.covariates]
    _check_present(bag, named, given, further)
    expected = {name: _expected(bag, source, STREAMS[name], name in given) for name, source in named.items()}
    read = _Reader(bag, [*named.values(), *further], {s: expected[n] for n, s in named.items()}, every)
    streams = {name: read.stream(source, STREAMS[name]) for name, source in named.items() if expected[name]}
    scalars = {topic: found for topic, found in read.found.items() if found.type in SCALAR_LAYOUTS}
    scalars |= {_name(bag, s): read.stream(s, SCALAR_TARGET) for s in further if _name(bag, s) not in scalars}
    tree, poses = read.tree(), (streams["slider"], streams["pusher"])
    return Selection(*poses, streams.get("wrench"), scalars, tuple(read.notes), tree, read.world)


class _Reader:
    """The messages of all topics that sources need, read in one pass; notes grow as streams are converted."""

    def __init__(self, bag: Bag, sources: Collection[Source], expected: Mapping[Source, str], topics: Topics) -> None:
        self.bag, self.topics, self.world, self.notes = bag, topics, topics.world, list[str]()
        self._trees: dict[str, TransformTree] = {}
        self._frames = [source for source in sources if source.frame]
        types = {topic: kind for topic, kind in bag.topics.items() if kind in SCALAR_LAYOUTS}
        types |= {
            topic: expected.get(source) or bag.topics[topic]
            for source in sources
            if (topic := _named(bag, source.topic)) in bag.topics
        }
        self._tf = _named(bag, next((source.topic for source in self._frames), TF))
        of_tf = [_named(bag, source.topic) for source in self._frames]
        of_tf += [self._tf] if topics.wrench_tf_frame or topics.world else []
        both = [name for topic in of_tf for name in (topic, topic + STATIC) if bag.topics.get(name) in TF_TYPES]
        self.found = _collected(bag, types | {name: bag.topics[name] for name in both})

    def tree(self) -> TransformTree | None:
        """The frames of tf, None where the wrench needs none or the bag has no tf. Raises RecordingError."""
        if not self.topics.wrench_tf_frame or not self._has_tf:
            return None
        try:
            return self._tree(self._tf)
        except TransformError as error:
            raise RecordingError(f"{self.bag.path}: topic {self._tf}: {error}") from None

    @property
    def _has_tf(self) -> bool:
        return self._tf in self.found or self._tf + STATIC in self.found

    def stream(self, source: Source, target: Target) -> Messages:
        """The messages of a source as messages of the target's type. Raises RecordingError if there is none."""
        found = self.found[_named(self.bag, source.topic)]
        self._check_found(found, target)
        if source.frame:
            return self._posed(source, found)
        where = field_to_read(source, found.type, target, self.bag.schemas, self.bag.path)
        if found.type != target.type or source.field:
            data = messages_as(
                target, found.data, found.log_times, found.type, where, definitions_of(found.type, self.bag.schemas)
            )
            found = Messages(_name(self.bag, source), target.type, found.log_times, data, found.foreign)
        return self._in_world(source, found) if target is POSE_TARGET and self.topics.world else found

    def _in_world(self, source: Source, found: Messages) -> Messages:
        """The poses in the frame that was chosen as the world."""
        try:
            data, known = poses_in_world(found.data, self.world, self._tree(self._tf) if self._has_tf else None)
        except TransformError as error:
            problem = (
                f"{error}; the frame of the poses is turned into world_frame {self.world!r} (option --world-frame)"
            )
            raise source.error(self.bag.path, problem) from None
        self._note_without(found.topic, int(np.sum(~known)))
        kept = np.flatnonzero(known).tolist()
        log_times = [found.log_times[row] for row in kept]
        return Messages(found.topic, found.type, log_times, [data[row] for row in kept], found.foreign)

    def _posed(self, source: Source, found: Messages) -> Messages:
        """The poses of a frame as PoseStamped."""
        try:
            tree = self._tree(found.topic)
            if self.world and self.world not in tree.frames:
                raise RecordingError(f"{self.bag.path}: {_no_world(self.world, tree)}")
            self.world = self.world or tree.root(self._first_frame(found.topic))
            stamp, rows, without = tree.poses(source.frame, self.world)
        except TransformError as error:
            raise source.error(self.bag.path, str(error)) from None
        label = f"{found.topic}:{source.frame}"
        self._note_without(label, without)
        data = encode(stamp, rows, POSE_STAMPED, self.world)
        return Messages(label, POSE.name, stamp.tolist(), data)

    def _note_without(self, label: str, count: int) -> None:
        if count:
            self.notes.append(f"{label}: {count} samples outside the time, or in a dropout, of a transform; discarded")

    def _first_frame(self, topic: str) -> str:
        """The frame whose root is the world: that of the slider where both poses are frames."""
        return next(source.frame for source in self._frames if _named(self.bag, source.topic) == topic)

    def _tree(self, topic: str) -> TransformTree:
        if topic not in self._trees:
            both = [(self.found[name], name != topic) for name in (topic, topic + STATIC) if name in self.found]
            tree = read_tree([(found.data, found.type, static) for found, static in both])
            if tree.unreadable:
                self.notes.append(f"{topic}: {tree.unreadable} messages are not readable CDR; discarded")
            self._trees[topic] = tree
        return self._trees[topic]

    def _check_found(self, messages: Messages, target: Target) -> None:
        topic, kind = messages.topic, next(iter(messages.foreign), "")
        if messages.foreign and not messages.data:
            raise RecordingError(f"{self.bag.path}: topic {topic} is of type {kind!r}, {messages.type} is accepted")
        if target is POSE_TARGET and not messages.data:
            known = "".join(f"; {note}" for note in self.bag.notes[:3])
            raise RecordingError(f"{self.bag.path}: topic {topic} contains no readable message{known}")


def _no_world(world: str, tree: TransformTree) -> str:
    return f"world_frame {world!r} (option --world-frame): no frame {world!r}; the frames are {', '.join(tree.frames)}"


def _expected(bag: Bag, source: Source, target: Target, given: bool) -> str:
    """The type to read from a source's topic, '' without the topic."""
    kind = bag.topics.get(_named(bag, source.topic), "")
    if source.frame and kind not in TF_TYPES:
        raise source.error(bag.path, f"{source.topic} is of type {kind!r}; only {TF_TYPES[0]} has frames")
    fits = given or kind in target.known or not kind
    return kind if fits else target.type


def _check_present(bag: Bag, named: Mapping[str, Source], given: Collection[str], further: list[Source]) -> None:
    """Raise RecordingError for a missing topic, with the topics of the bag and their types."""
    present = ", ".join(f"{topic} ({kind})" for topic, kind in bag.topics.items()) or "no topic"
    for source in [*(named[name] for name in named if name in given), *further]:
        if _named(bag, source.topic) not in bag.topics:
            raise source.error(bag.path, f"no such topic; the bag contains {present}")
    poses = [source for name, source in named.items() if name not in given and STREAMS[name] is POSE_TARGET]
    missing = [(_named(bag, source.topic), source.option) for source in poses]
    if missing := [(topic, option) for topic, option in missing if topic not in bag.topics]:
        names, options = (" and ".join(each) for each in zip(*missing, strict=True))
        raise RecordingError(f"{bag.path}: no topic {names} of {POSE.name}; it contains {present}; give {options}")


def _named(bag: Bag, name: str) -> str:
    """The bag's own spelling of a topic's name."""
    return next((topic for topic in bag.topics if topic.strip("/") == name.strip("/")), absolute(name))


def _name(bag: Bag, source: Source) -> str:
    """The name of a source in notes and covariates: the topic, with its field."""
    return _named(bag, source.topic) + (f".{source.field}" if source.field else "")


def _collected(bag: Bag, types: Mapping[str, str]) -> dict[str, Messages]:
    found = {topic: Messages(topic, kind) for topic, kind in types.items()}
    for topic, kind, log_time, data in bag.messages(found):
        messages = found[topic]
        if kind != messages.type:
            messages.foreign[kind] += 1
            continue
        messages.log_times.append(log_time)
        messages.data.append(data)
    return found
