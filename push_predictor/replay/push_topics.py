# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The topics of a bag that contain the streams of pushes: those named by the caller, saved next to it, or usual."""

from __future__ import annotations

from collections.abc import Collection

from push_predictor.recordings.fields.sources import Source
from push_predictor.recordings.topics import DEFAULT_TOPICS, STREAMS, Topics

STATIC = "_static"  # /tf_static belongs to /tf


def push_topics(present: Collection[str], topics: Topics) -> frozenset[str]:
    """The topics of a bag that slider, pusher and wrench are read from, with the static transforms of a frame."""
    return frozenset(topic for stream in STREAMS for topic in _of_stream(stream, present, topics))


def missing_poses(present: Collection[str], topics: Topics) -> list[str]:
    """The topics of slider and pusher, as named, that a bag does not contain."""
    return [_named(stream, topics) for stream in ("slider", "pusher") if not _of_stream(stream, present, topics)]


def _named(stream: str, topics: Topics) -> str:
    return str(getattr(topics.over(DEFAULT_TOPICS), stream))


def _of_stream(stream: str, present: Collection[str], topics: Topics) -> list[str]:
    source = Source("", "", _named(stream, topics))
    name = source.topic.strip("/")
    names = {name, name + STATIC} if source.frame else {name}
    return [topic for topic in present if topic.strip("/") in names]
