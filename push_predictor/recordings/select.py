"""The messages of a bag that the streams of a recording are read from, in the types of a recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

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
from push_predictor.recordings.topics import DEFAULT_TOPICS, Topics

STATIC = "_static"  # /tf_static belongs to /tf
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
    """The messages of each stream. scalars: by topic name, or topic and field. notes: what was assumed on the way."""

    slider: Messages
    pusher: Messages
    wrench: Messages | None
    scalars: dict[str, Messages]
    notes: tuple[str, ...]


def select(bag: Bag, topics: Topics) -> Selection:
    """Read the messages of the topics, and convert other types to those of a recording.

    Raises RecordingError for a topic that is missing, empty, or of a type that does not fit.
    """
    every = topics.over(DEFAULT_TOPICS)
    named = {name: Source(f"{name}_topic", f"--{name}-topic", getattr(every, name)) for name in STREAMS}
    given = {name for name in STREAMS if getattr(topics, name)}
    further = [Source("covariate_topics", "--covariate-topic", text) for text in topics.covariates]
    _check_present(bag, named, given, further)
    expected = {name: _expected(bag, source, STREAMS[name], name in given) for name, source in named.items()}
    read = _Reader(bag, [*named.values(), *further], {s: expected[n] for n, s in named.items()}, every.world)
    streams = {name: read.stream(source, STREAMS[name]) for name, source in named.items() if expected[name]}
    scalars = {topic: found for topic, found in read.found.items() if found.type in SCALAR_LAYOUTS}
    scalars |= {_name(bag, s): read.stream(s, SCALAR_TARGET) for s in further if _name(bag, s) not in scalars}
    return Selection(streams["slider"], streams["pusher"], streams.get("wrench"), scalars, tuple(read.notes))


class _Reader:
    """The messages of all topics that sources need, read in one pass; notes grow as streams are converted."""

    def __init__(self, bag: Bag, sources: Collection[Source], expected: Mapping[Source, str], world: str) -> None:
        self.bag, self.world, self.notes = bag, world, list[str]()
        self._trees: dict[str, TransformTree] = {}
        self._frames = [source for source in sources if source.frame]
        types = {topic: kind for topic, kind in bag.topics.items() if kind in SCALAR_LAYOUTS}
        for source in sources:
            if (topic := _named(bag, source.topic)) in bag.topics:
                types[topic] = expected.get(source) or bag.topics[topic]
                if source.frame and topic + STATIC in bag.topics:
                    types[topic + STATIC] = bag.topics[topic + STATIC]
        self.found = _collected(bag, types)

    def stream(self, source: Source, target: Target) -> Messages:
        """The messages of a source as messages of the target's type. Raises RecordingError if there is none."""
        found = self.found[_named(self.bag, source.topic)]
        self._check_found(found, target)
        if source.frame:
            return self._posed(source, found)
        where = field_to_read(source, found.type, target, self.bag.schemas, self.bag.path)
        if found.type == target.type and not source.field:
            return found
        data = messages_as(
            target, found.data, found.log_times, found.type, where, definitions_of(found.type, self.bag.schemas)
        )
        return Messages(_name(self.bag, source), target.type, found.log_times, data, found.foreign)

    def _posed(self, source: Source, found: Messages) -> Messages:
        """The poses of a frame as PoseStamped."""
        try:
            tree = self._tree(found.topic)
            world = self.world or tree.root(self._first_frame(found.topic))
            stamp, rows, without = tree.poses(source.frame, world)
        except TransformError as error:
            raise source.error(self.bag.path, str(error)) from None
        label = f"{found.topic}:{source.frame}"
        if without:
            self.notes.append(
                f"{label}: {without} samples outside the time, or in a dropout, of a transform; discarded"
            )
        data = encode(stamp, rows, POSE_STAMPED, world)
        return Messages(label, POSE.name, stamp.tolist(), data)

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
