# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Where a live stream is, as a parameter names it; the grammar is that of recordings (docs/reference/recordings.md)."""

from __future__ import annotations

from dataclasses import replace

from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rclpy.validate_topic_name import validate_topic_name

from push_predictor.errors import RequestError
from push_predictor.recordings.fields.sources import Source
from push_predictor.recordings.select import STREAMS
from push_predictor.recordings.topics import DEFAULT_TOPICS, Topics

DEPTH = 5000  # the most that Fast DDS keeps: it rejects newer ones; memory grows as the queue fills
SILENT = 5.0  # s without a sample that are reported


def sources_of(topics: Topics) -> dict[str, Source]:
    """The source of each stream. Raises RequestError that names the parameter, its value and what is accepted."""
    every = topics.over(DEFAULT_TOPICS)
    return {name: _checked(name, Source(f"{name}_topic", "", getattr(every, name))) for name in STREAMS}


def resolved(node: Node, source: Source) -> Source:
    """The source with the name of its topic after remapping, for messages to people."""
    return replace(source, text=node.resolve_topic_name(source.topic) + source.text[len(source.topic) :])


def reliability_text(reliability: ReliabilityPolicy | None) -> str:
    """In words; empty for none."""
    return "" if reliability is None else reliability.name.lower().replace("_", " ")


def _checked(name: str, source: Source) -> Source:
    frame = "" if name == "wrench" else ", or a frame as in /tf:tool0"
    accepted = f"a topic, or a topic and a field as in /odom.pose.pose{frame}"
    try:
        validate_topic_name(source.topic)
    except InvalidTopicNameException as error:
        raise RequestError(source.key, source.text, f"{accepted} ({' '.join(str(error).split())})") from None
    if source.topic.startswith("~") or (":" in source.text and (name == "wrench" or not source.frame)):
        raise RequestError(source.key, source.text, accepted)
    return source
