# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The streams of slider, pusher and wrench from messages while they are recorded.

The rules are those of reading a bag. A type that does not fit becomes a problem in words: recording goes on.
"""

from __future__ import annotations

from collections import Counter

from push_predictor.errors import RecordingError
from push_predictor.online.recorder.recorded_topics import COVARIATE, sources_of
from push_predictor.online.sensors.transform_buffer import TransformBuffer
from push_predictor.online.stream_sync import Samples
from push_predictor.recordings.bag.cdr import POSE_STAMPED, encode
from push_predictor.recordings.fields.sources import TF_TYPES, Source, definitions_of, field_to_read, messages_as
from push_predictor.recordings.samples import (
    PUSHER,
    SLIDER,
    WRENCH,
    check_samples,
    pusher_stream,
    slider_stream,
    wrench_stream,
)
from push_predictor.recordings.select import STATIC, STREAMS
from push_predictor.recordings.topics import Topics
from push_predictor.types import Array, IntArray

PLACE = "recording"  # what errors name as the bag
RULES = {"slider": SLIDER, "pusher": PUSHER, "wrench": WRENCH}


class LiveStreams:
    """Decodes portions of messages. topics: with full names; received: number of samples by stream.

    problems: why a stream has no samples, and how many were rejected, by stream.
    """

    def __init__(self, topics: Topics) -> None:
        self.received: Counter[str] = Counter()
        self._rejected = {name: Counter[str]() for name in STREAMS}
        self._refused: dict[str, str] = {}
        self._sources = {name: source for name, source in sources_of(topics) if name != COVARIATE}
        self._types: dict[str, str] = {}
        self._schemas: dict[str, str] = {}
        self._waiting: dict[str, list[tuple[int, bytes]]] = {}
        frames: dict[str, list[str]] = {}
        for source in self._sources.values():
            if source.frame:  # the slider's comes first: its root is the world
                frames.setdefault(source.topic, []).append(source.frame)
            else:
                self._waiting[source.topic] = []
        self._frames = {topic: TransformBuffer(names, topics.world) for topic, names in frames.items()}

    def add_topic(self, topic: str, type_name: str, schema: str) -> None:
        """State the type of a topic; schema: its definition, '' if unknown."""
        self._types[topic], self._schemas[type_name] = type_name, schema

    def put(self, topic: str, log_time: int, data: bytes) -> None:
        """Add a message; one of a topic that no stream needs is ignored."""
        if (frames := self._frames.get(topic.removesuffix(STATIC))) is not None:
            frames.put(data, static=topic.endswith(STATIC))
        elif topic in self._waiting:
            self._waiting[topic].append((log_time, data))

    def take(self) -> Samples:
        """The usable samples since the last call."""
        slider, pusher, wrench = (self._checked(name) for name in STREAMS)
        self._waiting = {topic: [] for topic in self._waiting}
        return Samples(slider_stream(*slider), pusher_stream(*pusher), wrench_stream(*wrench))

    @property
    def problems(self) -> dict[str, str]:
        """{stream: why it has no samples, or which were rejected}."""
        found = {
            name: f"{self._sources[name].text}: {kinds.total()} samples were rejected ("
            + ", ".join(f"{kind} {count}" for kind, count in kinds.items())
            + ")."
            for name, kinds in self._rejected.items()
            if kinds
        }
        return found | self._refused

    def _checked(self, name: str) -> tuple[IntArray, Array]:
        checked = check_samples(self._messages(name), RULES[name])
        self._rejected[name].update(checked.rejected)
        self.received[name] += int(checked.usable.sum())
        return checked.stamp[checked.usable], checked.values[checked.usable]

    def _messages(self, name: str) -> list[bytes]:
        """The messages of a stream in the type of a recording."""
        source = self._sources[name]
        kind = self._types.get(source.topic)
        if kind is None:
            return []
        try:
            found = self._converted(name, source, kind)
        except RecordingError as error:
            self._refused[name] = str(error)
            return []
        self._refused.pop(name, None)
        return found

    def _converted(self, name: str, source: Source, kind: str) -> list[bytes]:
        if source.frame:
            if kind not in TF_TYPES:
                raise source.error(PLACE, f"{source.topic} is of type {kind!r}; only {TF_TYPES[0]} has frames")
            return self._posed(source)
        target, waiting = STREAMS[name], self._waiting[source.topic]
        where = field_to_read(source, kind, target, self._schemas, PLACE)
        data = [message for _, message in waiting]
        if kind == target.type and not source.field:
            return data
        times = [log_time for log_time, _ in waiting]
        return messages_as(target, data, times, kind, where, definitions_of(kind, self._schemas))

    def _posed(self, source: Source) -> list[bytes]:
        buffer = self._frames[source.topic]
        stamp, rows = buffer.take(source.frame)
        if problem := buffer.problem(source.frame):
            raise source.error(PLACE, problem)
        return encode(stamp, rows, POSE_STAMPED, buffer.world)
