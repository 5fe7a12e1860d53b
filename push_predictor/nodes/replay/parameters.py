# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of push_replay: rosbag2's names under `play.`, times in seconds, and the node's own."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.node import Node

from push_predictor.errors import RequestError
from push_predictor.nodes.parameters import Param, declare, values_of
from push_predictor.recordings.topics import Topics, topics_of
from push_predictor.replay.clock import SECOND
from push_predictor.replay.player import PlayRange

_LONGEST = 1.0e10  # s, 300 years: longer than any stamp
SAVED = "Empty: as in NAME.recording.yaml"
PARAMETERS: tuple[Param, ...] = (
    Param("recording", "", "recording to play: a rosbag2 folder, .mcap, .db3 or .bag file, or folder of CSV streams"),
    Param("rig", "", "YAML file with the rig; it replaces the push_rig record of the recording"),
    Param("slider_topic", "", f"the slider's pose: TOPIC, TOPIC.FIELD or /tf:FRAME. {SAVED}, or slider/pose"),
    Param("pusher_topic", "", f"the pose of the pusher's tip, in the same manner. {SAVED}, or pusher/pose"),
    Param("wrench_topic", "", f"the wrench at the tip: TOPIC or TOPIC.FIELD. {SAVED}, or pusher/wrench"),
    Param("wrench_frame", "", f"axes of the wrench: world, tip or a frame of tf. {SAVED}, or world"),
    Param("world_frame", "", f"frame of the poses, into which tf turns others. {SAVED}, or their own"),
    Param(
        "wait_for_subscribers",
        0.0,
        "longest time in s to wait until every push topic and the rig have a subscriber",
        0.0,
        3600.0,
    ),
    Param("exit_when_finished", False, "end the process after the last message"),
    Param("strict", False, "report a warning of the check of the recording as an error in the diagnostics"),
    Param("play.rate", 1.0, "recorded seconds per second of wall time", 1.0e-6, 1.0e6),
    Param("play.loop", False, "start again after the last message"),
    Param("play.start_paused", False, "start paused"),
    Param("play.start_offset", 0.0, "start so many s after the first message", 0.0, _LONGEST),
    Param("play.playback_duration", -1.0, "play so many s of the recording (negative: all)", -_LONGEST, _LONGEST),
    Param("play.playback_until_timestamp", -1.0, "log time of the end, s (negative: none)", -_LONGEST, _LONGEST),
    Param("play.delay", 0.0, "wait so many s before playing, in each loop", 0.0, _LONGEST),
    Param("play.clock_publish_frequency", 0.0, "/clock messages per second of wall time (0: none)", 0.0, 1000.0),
    Param("play.clock_publish_on_topic_publish", False, "publish /clock with the log time before each message"),
    Param("play.clock_trigger_topics", [""], "topics before whose messages it does so (empty: all)"),
    Param("play.topics_to_filter", [""], "topics to play (empty: all)"),
    Param("play.regex_to_filter", "", "also play topics that match this regular expression"),
    Param("play.exclude_topics_to_filter", [""], "topics not to play"),
    Param("play.exclude_regex_to_filter", "", "do not play topics that match this regular expression"),
    Param("play.read_ahead_queue_size", 1000, "messages to read ahead and sort by log time", 1, 1e6),
    Param("play.wait_acked_timeout", 5.0, "s to wait for acknowledgements at the end (0: no limit)", -1.0, _LONGEST),
)


@dataclass(frozen=True)
class TopicFilter:
    """The topics to play; names with or without the leading slash."""

    topics: tuple[str, ...]
    regex: str
    excluded_topics: tuple[str, ...]
    excluded_regex: str

    def accepts(self, topic: str) -> bool:
        """Whether a topic is played: listed or matched (all, if there is no list and no expression), not excluded."""
        if _listed(topic, self.excluded_topics) or _matches(self.excluded_regex, topic):
            return False
        return not (self.topics or self.regex) or _listed(topic, self.topics) or _matches(self.regex, topic)


@dataclass(frozen=True)
class ReplayOptions:
    """The options of a replay; times in ns.

    clock_triggers: topics before whose messages /clock is published if clock_with_topics, empty for all. topics: of the
    streams of pushes, where they were given.
    """

    recording: Path
    rig: Path | None
    wait_for_subscribers: int
    exit_when_finished: bool
    rate: float
    loop: bool
    start_paused: bool
    range: PlayRange
    delay: int
    clock_frequency: float
    clock_with_topics: bool
    clock_triggers: tuple[str, ...]
    filter: TopicFilter
    window: int
    acked_timeout: int
    strict: bool
    topics: Topics

    def triggers_clock(self, topic: str) -> bool:
        """Whether /clock is published with the log time before each message of a topic."""
        return self.clock_with_topics and (not self.clock_triggers or _listed(topic, self.clock_triggers))


def replay_options(values: Mapping[str, Any]) -> ReplayOptions:
    """The options for parameter values by name. Raises RequestError for a wrong value."""
    return ReplayOptions(
        recording=_recording(values),
        rig=_path(values["rig"]),
        wait_for_subscribers=_ns(values["wait_for_subscribers"]),
        exit_when_finished=values["exit_when_finished"],
        rate=values["play.rate"],
        loop=values["play.loop"],
        start_paused=values["play.start_paused"],
        range=PlayRange(
            _ns(values["play.start_offset"]),
            _limit(values["play.playback_duration"]),
            _limit(values["play.playback_until_timestamp"]),
        ),
        delay=_ns(values["play.delay"]),
        clock_frequency=values["play.clock_publish_frequency"],
        clock_with_topics=values["play.clock_publish_on_topic_publish"],
        clock_triggers=tuple(values["play.clock_trigger_topics"]),
        filter=_filter(values),
        window=values["play.read_ahead_queue_size"],
        acked_timeout=_ns(values["play.wait_acked_timeout"]),
        strict=values["strict"],
        topics=topics_of(values),
    )


def _recording(values: Mapping[str, Any]) -> Path:
    if not values["recording"]:
        raise RequestError("recording", "", "the path of a recording (docs/reference/recordings.md)")
    return Path(values["recording"]).expanduser()


def _filter(values: Mapping[str, Any]) -> TopicFilter:
    for name in ("play.regex_to_filter", "play.exclude_regex_to_filter"):
        try:
            re.compile(values[name])
        except re.error as error:
            raise RequestError(name, values[name], f"a regular expression ({error})") from None
    return TopicFilter(
        tuple(values["play.topics_to_filter"]),
        values["play.regex_to_filter"],
        tuple(values["play.exclude_topics_to_filter"]),
        values["play.exclude_regex_to_filter"],
    )


def _listed(topic: str, names: tuple[str, ...]) -> bool:
    return topic.strip("/") in {name.strip("/") for name in names}


def _matches(regex: str, topic: str) -> bool:
    return bool(regex) and re.fullmatch(regex, topic) is not None


def _limit(seconds: float) -> int | None:
    return None if seconds < 0.0 else _ns(seconds)


def _ns(seconds: float) -> int:
    return round(seconds * SECOND)


def _path(text: str) -> Path | None:
    return Path(text).expanduser() if text else None


def read_options(node: Node) -> ReplayOptions:
    """Declare and read the parameters. Raises RequestError for a value that is not accepted."""
    declare(node, PARAMETERS)
    return replay_options(values_of(node, PARAMETERS))
