# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The options of a replay, made from the values of the node's parameters."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from push_predictor.errors import RequestError
from push_predictor.recordings.topics import STREAMS, Topics
from push_predictor.replay.clock import SECOND
from push_predictor.replay.play_range import PlayRange


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

    storage: rosbag2's name of the recording's format, empty for any. clock_triggers: topics before whose messages
    /clock is published if clock_with_topics, empty for all. topics: of the streams of pushes, where they were given.
    """

    recording: Path
    rig: Path | None
    restamp: bool
    spin: int
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
    storage: str
    filter: TopicFilter
    qos_overrides: Path | None
    window: int
    acked_timeout: int
    strict: bool
    topics: Topics

    def triggers_clock(self, topic: str) -> bool:
        """Whether /clock is published with the log time before each message of a topic."""
        return self.clock_with_topics and (not self.clock_triggers or _listed(topic, self.clock_triggers))


def replay_options(values: Mapping[str, Any], times: Mapping[str, int]) -> ReplayOptions:
    """The options for parameter values by name and times (ns) by name. Raises RequestError for a wrong value."""
    if values["restamp"] and values["play.rate"] != 1.0:
        accepted = "1.0, which restamp requires, or restamp false"
        raise RequestError("play.rate", values["play.rate"], accepted)
    for name in ("play.start_offset", "play.delay"):
        if times[name] < 0:
            raise RequestError(name, times[name] / SECOND, "0 s or more")
    return _options(values, times)


def _options(values: Mapping[str, Any], times: Mapping[str, int]) -> ReplayOptions:
    return ReplayOptions(
        recording=_recording(values),
        rig=_path(values["rig"]),
        restamp=values["restamp"],
        spin=values["spin_us"] * 1000,
        wait_for_subscribers=round(values["wait_for_subscribers"] * SECOND),
        exit_when_finished=values["exit_when_finished"],
        rate=values["play.rate"],
        loop=values["play.loop"],
        start_paused=values["play.start_paused"],
        range=PlayRange(
            times["play.start_offset"],
            _limit(times["play.playback_duration"]),
            _limit(times["play.playback_until_timestamp"]),
        ),
        delay=times["play.delay"],
        clock_frequency=values["play.clock_publish_frequency"],
        clock_with_topics=values["play.clock_publish_on_topic_publish"],
        clock_triggers=tuple(values["play.clock_trigger_topics"]),
        storage=values["storage.storage_id"],
        filter=_filter(values),
        qos_overrides=_path(values["play.qos_profile_overrides_path"]),
        window=values["play.read_ahead_queue_size"],
        acked_timeout=times["play.wait_acked_timeout"],
        strict=values["strict"],
        topics=_topics(values),
    )


def _recording(values: Mapping[str, Any]) -> Path:
    paths = {Path(values[name]).expanduser() for name in ("recording", "storage.uri") if values[name]}
    if not paths:
        raise RequestError("recording", "", "the path of a recording (docs/reference/recordings.md)")
    if len(paths) > 1:
        accepted = f"one recording: recording is {values['recording']!r}"
        raise RequestError("storage.uri", values["storage.uri"], accepted)
    return paths.pop()


def _topics(values: Mapping[str, Any]) -> Topics:
    named = {stream: values[f"{stream}_topic"] for stream in STREAMS}
    return Topics(**named, world=values["world_frame"], wrench_frame=values["wrench_frame"])


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


def _limit(time: int) -> int | None:
    return None if time < 0 else time


def _path(text: str) -> Path | None:
    return Path(text).expanduser() if text else None
