# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Messages of a bag from any log time on, sorted within a read-ahead window, and the topics of the streams in it."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterable, Iterator
from itertools import islice

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.reader import Bag, RawMessage
from push_predictor.recordings.decoder.sources import POSES, STATIC, STREAMS, sources_of
from push_predictor.recordings.topics import Topics

FIRST = 100  # messages, enough to find the earliest log time


class BagSource:
    """Chosen topics of a bag.

    start: log time of the first message of any topic, ns (0 in an empty bag). damage: what could not be read so far.
    """

    def __init__(self, bag: Bag, topics: Collection[str]) -> None:
        self._bag = bag
        self._topics = topics
        self._refused: list[str] = []
        first = islice(self._read(None), FIRST)
        self.start = min((message.log_time for message in first), default=0)

    @property
    def damage(self) -> list[str]:
        """What could not be read, with file and position."""
        return [*self._bag.notes, *self._refused]

    def messages(self, start: int) -> Iterator[RawMessage]:
        """Messages of the chosen topics from a log time on, in file order; unreadable parts are added to damage."""
        return (message for message in self._read(self._topics) if message.log_time >= start)

    def _read(self, topics: Collection[str] | None) -> Iterator[RawMessage]:
        try:
            yield from self._bag.messages(topics)
        except RecordingError as error:
            if str(error) not in self._refused:
                self._refused.append(str(error))


def sorted_within(messages: Iterable[RawMessage], size: int) -> Iterator[RawMessage]:
    """The messages, sorted by log time within a window of `size` messages.

    Recordings are roughly in order. A message that comes later than the window allows is returned as soon as it is
    read.
    """
    window: list[tuple[int, int, RawMessage]] = []
    for number, message in enumerate(messages):
        heapq.heappush(window, (message.log_time, number, message))
        if len(window) >= size:
            yield heapq.heappop(window)[2]
    yield from (message for _, _, message in sorted(window))


def push_topics(present: Collection[str], topics: Topics) -> frozenset[str]:
    """The topics of a bag that slider, pusher and wrench are read from, with the static transforms of a frame."""
    return frozenset(topic for stream in STREAMS for topic in _of_stream(stream, present, topics))


def missing_poses(present: Collection[str], topics: Topics) -> list[str]:
    """The topics of slider and pusher, as named, that a bag does not contain."""
    named = dict(sources_of(topics))
    return [named[stream].text for stream in POSES if not _of_stream(stream, present, topics)]


def _of_stream(stream: str, present: Collection[str], topics: Topics) -> list[str]:
    source = dict(sources_of(topics))[stream]
    name = source.topic.strip("/")
    names = {name, name + STATIC} if source.frame else {name}
    return [topic for topic in present if topic.strip("/") in names]
