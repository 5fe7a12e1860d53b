# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The subscriptions to scalar topics: made when the topics appear, with the type and QoS of their publishers.

A message without a header gets the time of /clock if that is published, else the time at which it was sent.
push_replay publishes each such message's log time on /clock just before it, so the message gets the same stamp as when
the recording is read.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import monotonic, time_ns

from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.validate_topic_name import validate_topic_name

from push_predictor.errors import PushPredictorError, RecordingError, RequestError
from push_predictor.nodes.following import FollowingSubscription
from push_predictor.nodes.message_text import definition_of
from push_predictor.online.scalar_buffer import ClockHistory, ScalarBuffer
from push_predictor.recordings.bag.definitions import SCALAR_LAYOUTS
from push_predictor.recordings.fields.sources import (
    SCALAR_TARGET,
    FieldReader,
    Source,
    definitions_of,
    field_to_read,
)
from push_predictor.recordings.streams import ScalarStream

LOOK = 0.05  # s between two looks at the publishers
CLOCK_DELAY = 1_000_000_000  # ns after sending a message within which its /clock arrives, if there is one
STALE = 5_000_000_000  # ns after the last message of a /clock without publisher, when its time expires
CLOCK, CLOCK_TYPE = "/clock", "rosgraph_msgs/msg/Clock"


@dataclass(eq=False)
class _Topic:
    """A requested topic. name: as in the covariate; problem: why there are no samples, empty if there are.

    fields: by message type, what reads the field that was named; None where the type is a scalar's and needs none.
    """

    source: Source
    name: str
    reader: FollowingSubscription
    problem: str = ""
    buffer: ScalarBuffer | None = None
    fields: dict[str, FieldReader | None] = field(default_factory=dict)
    refusals: dict[str, str] = field(default_factory=dict)  # by message type

    def understands(self, kind: str) -> bool:
        """Whether messages of a type have the number; remembers why not."""
        if kind in self.fields or kind in self.refusals:
            return kind in self.fields
        if kind in SCALAR_LAYOUTS and not self.source.field:
            self.fields[kind] = None
            return True
        try:
            schemas = {kind: definition_of(kind)}
            path = field_to_read(self.source, kind, SCALAR_TARGET, schemas, "")
            self.fields[kind] = FieldReader(SCALAR_TARGET, kind, path, definitions_of(kind, schemas))
        except RecordingError as error:
            self.refusals[kind] = str(error)
        except PushPredictorError as error:
            self.refusals[kind] = str(self.source.error("", str(error)))
        return kind in self.fields


class ScalarSubscriber:
    """Subscribes to scalar topics: each a topic of a scalar type, or TOPIC.FIELD of any type with a number.

    names: relative or absolute; topic:/NAME is the covariate, as the name was given.

    Call `look` and `take` in the executor's thread, `drain` in any. Raises RequestError for an invalid name.
    """

    def __init__(self, node: Node, names: Sequence[str]) -> None:
        _check(names)
        self._node = node
        sources = [Source("scalar_topics", "", text) for text in names]
        self._topics = [_Topic(each, _name(each.text), FollowingSubscription(node, each.topic)) for each in sources]
        self._ticks, self._clock = FollowingSubscription(node, CLOCK), ClockHistory()
        self._clock_published = False
        self._looked = 0.0
        self._draining = threading.Lock()
        self.look()

    @property
    def names(self) -> list[str]:
        """The requested topics, as the covariates name them."""
        return [topic.name for topic in self._topics]

    def look(self) -> None:
        """Subscribe to topics that have appeared. Call it often."""
        if not self._topics or monotonic() - self._looked < LOOK:
            return
        self._looked = monotonic()
        with self._draining:
            for topic in self._topics:
                self._find(topic)
            publishers = self._ticks.publishers()
            self._clock_published = bool(publishers)
            if publishers:
                self._ticks.follow(CLOCK_TYPE, publishers)

    def drain(self) -> None:
        """Move arrived messages from the middleware into the buffers."""
        with self._draining:
            for topic in self._topics:
                for taken in topic.reader.taken():
                    assert topic.buffer is not None
                    topic.buffer.put(taken.message, taken.sent)
            for taken in self._ticks.taken():
                self._clock.put(taken.message, taken.sent)

    def waiting(self) -> bool:
        """Whether messages of every published topic wait."""
        return all(len(topic.buffer) > 0 for topic in self._topics if topic.buffer is not None)

    def take(self, near: int | None, last: bool = False) -> dict[str, ScalarStream]:
        """The samples since the last call of every topic that is or was published.

        near: a recent stamp (ns) of the poses, None if there is none. A message that still waits for its time on /clock
        is returned by a later call, or, if this is the last, now.
        """
        until, time_of = self._dating()
        until = sys.maxsize if last else until
        with self._draining:
            published = [(topic.name, topic.buffer) for topic in self._topics if topic.buffer is not None]
            return {name: buffer.take(until, time_of, near) for name, buffer in published}

    def figures(self) -> dict[str, int]:
        """Counts of messages by topic; rejected ones also by kind, for the kinds that occurred."""
        found: dict[str, int] = {}
        for topic in self._topics:
            if topic.buffer is not None:
                found |= {f"topic:{topic.name} samples": topic.buffer.received}
                found |= {f"topic:{topic.name} rejected {kind}": count for kind, count in topic.buffer.rejected.items()}
        return found

    def problems(self) -> list[str]:
        """In words, which topics have no samples, and which samples of the others were rejected."""
        found = [topic.problem for topic in self._topics if topic.problem]
        for topic in self._topics:
            if topic.buffer is not None and topic.buffer.rejected:
                kinds = ", ".join(f"{kind} {count}" for kind, count in topic.buffer.rejected.items())
                found.append(f"{topic.name}: {topic.buffer.rejected.total()} samples were rejected ({kinds}).")
        return found

    def _find(self, topic: _Topic) -> None:
        """Subscribe to a published topic, or note why not; one that has lost its publishers stays as it is."""
        publishers = topic.reader.publishers()
        kinds = sorted({publisher.topic_type for publisher in publishers})
        usable = [kind for kind in kinds if topic.understands(kind)]
        if len(usable) == 1:
            if topic.buffer is None or topic.buffer.kind != usable[0]:
                topic.buffer, topic.problem = ScalarBuffer(usable[0], topic.fields[usable[0]]), ""
            topic.reader.follow(usable[0], [p for p in publishers if p.topic_type == usable[0]])
        elif kinds:
            topic.problem = _refusal(topic, kinds)
        elif topic.buffer is None:
            topic.problem = f"Scalar topic {topic.name} has no publisher."

    def _dating(self) -> tuple[int, Callable[[int], int | None]]:
        """The sending time (ns) up to which messages can be dated now, and the function that dates them."""
        newest, at = self._clock.newest, self._clock.at
        if self._clock_published:
            return newest or 0, at
        expired = 0 if newest is None else newest + STALE
        return time_ns() - CLOCK_DELAY, lambda sent: sent if sent > expired else at(sent)


def _refusal(topic: _Topic, kinds: Sequence[str]) -> str:
    """Why a topic with publishers of these types is not subscribed to."""
    if len(kinds) > 1:
        return f"Scalar topic {topic.name} has publishers of the types {', '.join(kinds)}. One type is accepted."
    reason = topic.refusals[kinds[0]]
    return f"{reason}; without a field {', '.join(SCALAR_LAYOUTS)} are accepted."


def _check(names: Sequence[str]) -> None:
    for text in names:
        source = Source("scalar_topics", "", text)
        try:
            validate_topic_name(source.topic)
        except InvalidTopicNameException as error:
            accepted = f"a topic's name, or TOPIC.FIELD ({' '.join(str(error).split())})"
            raise RequestError("scalar_topics", text, accepted) from None
        if ":" in text or text.endswith("."):
            raise RequestError("scalar_topics", text, "a topic's name, or TOPIC.FIELD")
        if text.startswith("~") or [_name(other) for other in names].count(_name(text)) > 1:
            raise RequestError("scalar_topics", text, "relative or absolute names, each topic or field once")


def _name(requested: str) -> str:
    """The name in a recording, whatever the node's namespace: with a slash before it."""
    return f"/{requested.strip('/')}"
