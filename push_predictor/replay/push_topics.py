# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The topics of a bag that contain the streams of pushes: those named by the caller, saved next to it, or usual."""

from __future__ import annotations

from collections.abc import Collection

from push_predictor.recordings.decoder.sources import POSES, STATIC, STREAMS, sources_of
from push_predictor.recordings.topics import Topics


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
