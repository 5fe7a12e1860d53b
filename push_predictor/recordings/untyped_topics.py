# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The types of a bag's topics that were recorded without a schema, told from their bytes as far as a stream needs them.

A message fits a type if it is as long as the type, its texts are texts, its stamps are times and its quaternions have
length one. Types of equal layout (WrenchStamped and TwistStamped) cannot be told apart: the stream decides.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice

import numpy as np

from push_predictor.recordings.bag.message_types import STANDARD, type_at
from push_predictor.recordings.bag.messages import Messages, Notes
from push_predictor.recordings.bag.reader import Bag
from push_predictor.recordings.decoder.sources import STATIC, STREAMS, sources_of
from push_predictor.recordings.fields.columns import Block, whole_block
from push_predictor.recordings.fields.sources import SCALAR_TARGET, TF_TYPES, Source, Target, fields_in
from push_predictor.recordings.topics import Topics

SAMPLE = 20  # messages by which a type is told
LEAST_FITTING = 0.9  # share of the messages: a lost body may have any quaternion
UNIT = 1e-3  # deviation of a quaternion's length from one; 32-bit numbers have 1e-7
LARGEST, SMALLEST = 1e9, 1e-30  # of a measured number but zero, in SI units; other bytes read as numbers are beyond
_NANOSECONDS = 1e9


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


def candidates(source: Source, target: Target) -> list[str]:
    """The types that a source's messages can have, if their schema is missing."""
    if source.frame:
        return [TF_TYPES[0]]
    if not source.field:
        return list(target.known)
    names = [f"{package}/msg/{name}" for package, name in (each.split("/") for each in STANDARD)]
    fields = fields_in(source.field)
    return [name for name in names if target.fits([type_at(STANDARD, name, each) for each in fields])]


def told_type(messages: Sequence[bytes], kinds: Sequence[str]) -> str:
    """The first of the types that nearly all messages fit, '' if none does."""
    needed = LEAST_FITTING * len(messages)
    return next((kind for kind in kinds if 0 < needed <= sum(_fits(each, kind) for each in messages)), "")


def _fits(message: bytes, kind: str) -> bool:
    block = whole_block(Messages.of("", kind, [0], [message]), STANDARD)
    return block is not None and _texts_fit(block) and _numbers_fit(block)


def _texts_fit(block: Block) -> bool:
    texts = [block.raw_text(path) for path in block.layout.texts]
    return all(text.endswith(b"\0") and text[:-1].decode(errors="replace").isprintable() for text in texts)


def _numbers_fit(block: Block) -> bool:
    numbers = {path: float(block.number(path)[0]) for path in block.layout.numbers}
    size = np.abs([value for path, value in numbers.items() if not path.endswith("sec")])
    measured = size[np.isfinite(size) & (size > 0.0)]
    if not np.all((measured < LARGEST) & (measured > SMALLEST)):
        return False
    if any(value >= _NANOSECONDS for path, value in numbers.items() if path.endswith(".nanosec")):
        return False
    return all(_is_unit([numbers[f"{path[:-1]}{axis}"] for axis in "xyzw"]) for path in numbers if path.endswith(".w"))


def _is_unit(quaternion: Sequence[float]) -> bool:
    """Whether a quaternion is one, or that of a lost body: zeros or NaN."""
    length = float(np.linalg.norm(quaternion))
    return not length > 0.0 or abs(length - 1.0) < UNIT
