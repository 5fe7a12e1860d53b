# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Messages of lab_bags through the decoder of streams, in portions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from lab_bags import Lab, Message

from push_predictor.recordings.bag.messages import Messages
from push_predictor.recordings.decoder.decoder import Samples, StreamDecoder, key_of
from push_predictor.recordings.decoder.topic_input import TopicInput
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import ScalarStream, joined
from push_predictor.recordings.topics import Topics


def input_of(own: TopicInput, kind: str, *messages: bytes, live: bool = True) -> TopicInput:
    """An input with messages of a type, one by one; the k-th was sent and received at k ns."""
    if own.kind != kind:
        own.declare(kind, {})
    for sent, message in enumerate(messages):
        own.put(Messages.of(own.source.topic, kind, [sent], [message]), np.array([sent]) if live else None)
    return own


def decoder_of(lab: Lab, topics: Topics, expected: str = "", rig: Rig | None = None) -> StreamDecoder:
    """A decoder to which the types of a laboratory are declared."""
    decoder = StreamDecoder(topics, expected)
    kinds = {key_of(topic): kind for topic, kind in lab.kinds.items()}
    for each in decoder.inputs().values():
        if kind := kinds.get(key_of(each.source.topic)):
            each.declare(kind, {kind: lab.definition(kind)})
    if rig is not None:
        decoder.begin(rig)
    return decoder


def put(decoder: StreamDecoder, lab: Lab, messages: Sequence[Message], live: bool = False) -> None:
    """Hand messages to a decoder, those of each topic at once."""
    for topic in dict.fromkeys(topic for _, topic, _ in messages):
        own = [message for message in messages if message[1] == topic]
        times = np.array([sent for sent, _, _ in own], np.int64)
        decoder.put(Messages.of(topic, lab.kinds[topic], times, [data for *_, data in own]), times if live else None)


def decoded(decoder: StreamDecoder, lab: Lab, portions: Iterable[Sequence[Message]], live: bool = False) -> Samples:
    """All samples, taken after each portion and at the end."""
    parts = []
    for portion in portions:
        put(decoder, lab, portion, live)
        parts.append(decoder.take())
    return joined_samples([*parts, decoder.take(last=True)])


def in_portions(messages: Sequence[Message], size: int) -> list[Sequence[Message]]:
    """Portions of a number of messages."""
    return [messages[first : first + size] for first in range(0, len(messages), size)]


def joined_samples(parts: Sequence[Samples]) -> Samples:
    """Portions as one."""
    names = dict.fromkeys(name for part in parts for name in part.scalars)
    nothing = ScalarStream(np.empty(0, np.int64), np.empty(0))
    scalars = {name: [part.scalars.get(name, nothing) for part in parts] for name in names}
    return Samples(
        joined([part.slider for part in parts]),
        joined([part.pusher for part in parts]),
        joined([part.wrench for part in parts]),
        {
            name: ScalarStream(*(np.concatenate([getattr(each, field) for each in of]) for field in ("stamp", "value")))
            for name, of in scalars.items()
        },
    )
