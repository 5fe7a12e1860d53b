# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Where the streams are, as topics name them, and which topics contain them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from push_predictor.recordings.fields.sources import POSE_TARGET, WRENCH_TARGET, Source
from push_predictor.recordings.topics import DEFAULT_TOPICS, Topics

TF, STATIC = "/tf", "_static"  # /tf_static belongs to /tf
STREAMS = {"slider": POSE_TARGET, "pusher": POSE_TARGET, "wrench": WRENCH_TARGET}
COVARIATE = "covariate"
POSES = ("slider", "pusher")


@dataclass(frozen=True)
class RecordedTopic:
    """A topic of a recording.

    uses: the streams that are read from it: slider, pusher, wrench or covariate. expected: its absence is a problem.
    static: it is silent for most of the time, as /tf_static.
    """

    name: str
    uses: tuple[str, ...]
    expected: bool = True
    static: bool = False


def topics_to_record(given: Topics, with_wrench: bool = True) -> tuple[RecordedTopic, ...]:
    """The topics of these streams, each once; streams that are not given have their default topic.

    with_wrench: whether the wrench is expected.
    """
    found: dict[str, RecordedTopic] = {}

    def add(topic: str, *uses: str, expected: bool = True, static: bool = False) -> None:
        known = found.get(topic, RecordedTopic(topic, (), expected, static))
        both = tuple(dict.fromkeys([*known.uses, *uses]))
        found[topic] = replace(known, uses=both, expected=known.expected or expected)

    for name, source in sources_of(given):
        add(source.topic, name, expected=name != "wrench" or with_wrench)
        if source.frame:
            add(source.topic + STATIC, name, expected=False, static=True)
    if given.world or given.wrench_tf_frame:  # by tf the poses or the wrench will be turned
        add(TF)
        add(TF + STATIC, expected=False, static=True)
    return tuple(found.values())


def sources_of(given: Topics) -> list[tuple[str, Source]]:
    """(stream, its source) of slider, pusher, wrench and each covariate."""
    every = given.over(DEFAULT_TOPICS)
    streams = [(name, Source(f"{name}_topic", getattr(every, name))) for name in STREAMS]
    return streams + [(COVARIATE, scalar_source(text)) for text in every.covariates]


def scalar_source(text: str) -> Source:
    """The source of a scalar."""
    return Source("covariate_topics", text)


def resolved(given: Topics, resolve: Callable[[str], str]) -> Topics:
    """The topics of all streams with their full names, by a function from a topic's name to its full name."""
    names: dict[str, list[str]] = {}
    for name, source in sources_of(given):
        names.setdefault(name, []).append(resolve(source.topic) + source.text[len(source.topic) :])
    streams = {name: names[name][0] for name in STREAMS}
    return replace(given, **streams, covariates=tuple(names.get(COVARIATE, ())))
