# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of push_recorder; the table in docs/reference/push_recorder.md repeats them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.validate_topic_name import validate_topic_name

from push_predictor.errors import RequestError
from push_predictor.nodes.parameters import Param, declare, values_of
from push_predictor.recordings.decoder.sources import resolved
from push_predictor.recordings.topics import Topics, load_topics, topics_of

PARAMETERS = (
    Param("bag", "", "Bag to write: a folder, or FILE.mcap. Required."),
    Param("force", False, "Replace a bag that exists."),
    Param("rig", "", "Rig file (YAML, a push_rig record) to record. Empty: the record on topic rig."),
    Param("slider_topic", "", "TOPIC, TOPIC.FIELD or /tf:FRAME of the slider's pose. Empty: slider/pose."),
    Param("pusher_topic", "", "TOPIC, TOPIC.FIELD or /tf:FRAME of the tip's pose. Empty: pusher/pose."),
    Param("wrench_topic", "", "TOPIC or TOPIC.FIELD of the wrench. Empty: pusher/wrench, if it is published."),
    Param("wrench_frame", "", "Axes of the wrench, saved for its readers: world, tip or a frame of tf."),
    Param("wrench_bias", "", "What readers do with the sensor's bias and weight: free_motion or none."),
    Param("world_frame", "", "Frame of all poses, saved for their readers, which turn others into it by tf."),
    Param("covariate_topics", [""], "Further topics to record: TOPIC or TOPIC.FIELD."),
    Param("duration", 0.0, "Seconds after the first message at which the node ends. 0: at SIGINT.", low=0.0, high=1e9),
    Param("diagnostics_period", 1.0, "Seconds between two messages on /diagnostics.", low=0.1, high=60.0),
)


@dataclass(frozen=True)
class RecorderOptions:
    """topics have full names. duration: s, 0 without end. rig: a file, '' for the topic rig.

    with_wrench: whether a topic of the wrench was given.
    """

    bag: Path
    topics: Topics
    rig: str
    duration: float
    diagnostics_period: float
    with_wrench: bool


def read_options(node: Node) -> RecorderOptions:
    """Declare and read the parameters.

    Raises RequestError that names the parameter, its value and what is accepted; RecordingError for an unreadable
    NAME.recording.yaml.
    """
    declare(node, PARAMETERS)
    values = values_of(node, PARAMETERS)
    bag = _bag(values)
    given = topics_of(values).over(load_topics(bag))
    topics = resolved(given, lambda topic: _full_name(node, topic))
    return RecorderOptions(
        bag, topics, values["rig"], values["duration"], values["diagnostics_period"], bool(given.wrench)
    )


def _bag(values: Mapping[str, Any]) -> Path:
    if not values["bag"]:
        raise RequestError("bag", "", "the path of a bag: a folder, or FILE.mcap")
    path = Path(values["bag"]).expanduser()
    if path.exists() and not values["force"]:
        raise RequestError("bag", str(path), "a path that does not exist, or force (option --force) to replace it")
    return path


def _full_name(node: Node, topic: str) -> str:
    try:
        validate_topic_name(topic)
        return str(node.resolve_topic_name(topic))
    except InvalidTopicNameException as error:
        raise RequestError("topic", topic, f"a topic's name ({' '.join(str(error).split())})") from None
