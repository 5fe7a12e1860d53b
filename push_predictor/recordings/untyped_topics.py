# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The types of a bag's topics that were recorded without a schema, as far as a stream needs them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice

from push_predictor.recordings.bag.notes import Notes
from push_predictor.recordings.bag.reader import Bag
from push_predictor.recordings.decoder.sources import STATIC, STREAMS, sources_of
from push_predictor.recordings.fields.sources import SCALAR_TARGET, TF_TYPES
from push_predictor.recordings.fields.untyped import candidates, told_type
from push_predictor.recordings.topics import Topics

SAMPLE = 20  # messages by which a type is told


def tell_types(bag: Bag, topics: Topics, tf: Iterable[str], notes: Notes) -> None:
    """Tell the types of the topics that these streams need; tf: topics of transforms.

    Raises RecordingError if a pose, or another stream that was given, fits no type.
    """
    for topic in (name for of in tf for name in (bag.spelled(of), bag.spelled(of) + STATIC)):
        _tell_type(bag, topic, TF_TYPES[:1], notes)
    sources = sources_of(topics)
    for name, source in sources:
        topic, kinds = bag.spelled(source.topic), candidates(source, STREAMS.get(name, SCALAR_TARGET))
        told = source.frame or _tell_type(bag, topic, kinds, notes)
        if not told and (name != "wrench" or topics.wrench):
            problem = f"{topic} was recorded without a schema, and its messages fit none of {', '.join(kinds)}"
            raise source.error(bag.path, problem)
    for topic in (topic for topic, kind in bag.topics.items() if not kind):
        lost = any(bag.spelled(source.topic) == topic for _, source in sources)
        notes.add(f"{topic} was recorded without a schema and is not read", lost=lost)


def _tell_type(bag: Bag, topic: str, kinds: Sequence[str], notes: Notes) -> bool:
    """Whether a topic has a type, if necessary that of these which its messages fit."""
    if bag.topics.get(topic) == "":
        sample = [message.data for message in islice(bag.messages({topic}), SAMPLE)]
        if kind := told_type(sample, kinds):
            bag.set_type(topic, kind)
            notes.add(f"{topic} was recorded without a schema; its messages are read as {kind}")
    return bag.topics.get(topic) != ""
