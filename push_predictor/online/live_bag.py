# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A bag that is created with its first message and grows under its final name."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

from push_predictor.errors import RecordingError
from push_predictor.recordings.bag.message_types import definition_text
from push_predictor.recordings.bag.metadata import TopicInfo
from push_predictor.recordings.bag.writer import BagWriter
from push_predictor.recordings.decoder.sources import POSES, sources_of
from push_predictor.recordings.rig import RECORD_NAME, Rig
from push_predictor.recordings.topics import Topics, save_topics


class LiveBag:
    """Writes messages and, next to the bag, the topics of its streams.

    path: a folder or FILE.mcap; an earlier bag of that name is replaced by the first message. schemas: {type:
    definition}; messages: number by topic. Raises RecordingError if path exists and is not a bag.
    """

    def __init__(self, path: Path, topics: Topics) -> None:
        self._writer = BagWriter(path, live=True)
        self.path = self._writer.path
        self.schemas: dict[str, str] = {}
        self.messages: Counter[str] = Counter()
        self._topics = topics
        self._declared: dict[str, TopicInfo] = {}
        self._rig: Rig | None = None
        self._open = False

    def type_of(self, topic: str) -> str:
        """The type that a topic was declared with, '' if it was not."""
        return self._declared[topic].type if topic in self._declared else ""

    def add_topic(self, topic: TopicInfo) -> str:
        """Declare a topic, once; returns why its definition is unknown, '' if it is known."""
        problem = ""
        try:
            self.schemas[topic.type] = definition_text(topic.type)
        except (RecordingError, OSError, UnicodeDecodeError) as error:
            self.schemas[topic.type] = ""
            problem = f"{topic.name} is recorded without the definition of its type: {error}."
        self._declared[topic.name] = topic
        if self._open:
            self._declare(topic)
            self._save_topics()
        return problem

    def set_rig(self, rig: Rig) -> None:
        """Record the rig, once."""
        self._rig = rig
        if self._open:
            self._writer.add_metadata(RECORD_NAME, rig.to_record())

    def write(self, topic: str, log_time: int, data: bytes) -> None:
        """Write a message of a declared topic; log_time in ns. Raises RecordingError that names the bag."""
        if not self._open:
            self._begin()
        self._writer.write(topic, log_time, data)
        self.messages[topic] += 1

    def flush(self) -> None:
        """Hand all complete chunks to the operating system. Raises RecordingError for a full disk."""
        if self._open:
            self._writer.flush()

    def close(self) -> None:
        """Complete the bag, if there is one. Raises RecordingError that names it."""
        if self._open:
            self._open = False
            self._writer.__exit__(None, None, None)

    def _begin(self) -> None:
        self._writer.__enter__()
        self._open = True
        if self._rig is not None:
            self._writer.add_metadata(RECORD_NAME, self._rig.to_record())
        for topic in self._declared.values():
            self._declare(topic)
        self._save_topics()

    def _save_topics(self) -> None:
        """Save the topics of slider and pusher, and of the other streams that are in the bag."""
        present = [s.text for name, s in sources_of(self._topics) if name in POSES or s.topic in self._declared]
        wrench = self._topics.wrench if self._topics.wrench in present else ""
        covariates = tuple(text for text in self._topics.covariates if text in present)
        try:
            save_topics(self.path, replace(self._topics, wrench=wrench, covariates=covariates))
        except OSError as error:
            raise RecordingError(f"{error.filename}: cannot be written ({error.strerror})") from None

    def _declare(self, topic: TopicInfo) -> None:
        self._writer.add_topic(
            topic.name,
            topic.type,
            self.schemas[topic.type],
            type_hash=topic.type_hash,
            depth=topic.depth,
            durability=topic.durability,
            reliability=topic.reliability,
        )
