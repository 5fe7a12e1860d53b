"""What push_replay can be told: the table of its parameters and the options they make."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.node import Node

from push_predictor.errors import RequestError
from push_predictor.nodes.parameters import Param, declare, given_value, values_of
from push_predictor.replay.clock import SECOND
from push_predictor.replay.range import PlayRange

_YEARS = 1.0e10  # s, beyond any stamp


def _duration(name: str, default: tuple[int, int], description: str) -> tuple[Param, Param]:
    """rosbag2's pair of integers; `name` itself, in seconds, is accepted in their place."""
    return (
        Param(f"{name}.sec", default[0], f"{description}: seconds", -_YEARS, _YEARS),
        Param(f"{name}.nsec", default[1], f"{description}: nanoseconds on top", -999_999_999, 999_999_999),
    )


PARAMETERS: tuple[Param, ...] = (
    Param("recording", "", "MCAP file, or folder of a rosbag2 MCAP bag, to play"),
    Param("rig", "", "YAML file with the rig; takes the place of the recording's push_rig record"),
    Param("restamp", False, "add one constant offset to all header stamps so that they begin now; rate 1 only"),
    Param("spin_us", 0, "busy-wait for the last microseconds before a deadline: less late, more CPU", 0, 5000),
    Param(
        "wait_for_subscribers",
        0.0,
        "wait at most so many s until every push topic is heard, and the rig",
        0.0,
        3600.0,
    ),
    Param("exit_when_finished", False, "end the process after the last message"),
    Param("play.rate", 1.0, "recorded seconds per second", 1.0e-6, 1.0e6),
    Param("play.loop", False, "begin again after the last message"),
    Param("play.start_paused", False, "begin paused"),
    *_duration("play.start_offset", (0, 0), "begin so far after the first message"),
    *_duration("play.playback_duration", (-1, 0), "play so much of the recording (negative: all)"),
    *_duration("play.playback_until_timestamp", (0, -1), "play up to this log time (negative: to the end)"),
    *_duration("play.delay", (0, 0), "wait so long before playing, in each loop"),
    Param("play.clock_publish_frequency", 40.0, "publish /clock so often per second of wall time, 0: not", 0.0, 1000.0),
    Param("play.clock_publish_on_topic_publish", False, "publish /clock with the log time before each message"),
    Param("play.topics_to_filter", [""], "play these topics (none given: all)"),
    Param("play.regex_to_filter", "", "play topics that this regular expression matches, besides topics_to_filter"),
    Param("play.exclude_topics_to_filter", [""], "do not play these topics"),
    Param("play.exclude_regex_to_filter", "", "do not play topics that this regular expression matches"),
    Param("play.qos_profile_overrides_path", "", "YAML file {topic: {reliability, depth, ...}} as for ros2 bag play"),
    Param("play.read_ahead_queue_size", 1000, "messages read ahead and sorted by log time", 1, 1e6),
    *_duration("play.wait_acked_timeout", (5, 0), "wait for acknowledgements at the end (0: forever, negative: not)"),
)
_DURATIONS = tuple(param.name.removesuffix(".sec") for param in PARAMETERS if param.name.endswith(".sec"))


@dataclass(frozen=True)
class TopicFilter:
    """Which topics are played; names with or without the leading slash."""

    topics: tuple[str, ...]
    regex: str
    excluded_topics: tuple[str, ...]
    excluded_regex: str

    def accepts(self, topic: str) -> bool:
        """Named or matched, where anything is named or matched at all, and not excluded."""
        if self._among(topic, self.excluded_topics) or _matches(self.excluded_regex, topic):
            return False
        return not (self.topics or self.regex) or self._among(topic, self.topics) or _matches(self.regex, topic)

    @staticmethod
    def _among(topic: str, names: tuple[str, ...]) -> bool:
        return topic.strip("/") in {name.strip("/") for name in names}


@dataclass(frozen=True)
class ReplayOptions:
    """The parameters as the replay uses them; times in ns."""

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
    filter: TopicFilter
    qos_overrides: Path | None
    window: int
    acked_timeout: int


def read_options(node: Node) -> ReplayOptions:
    """Declare and read the parameters. Raises RequestError for one that is not accepted."""
    seconds = {name: given_value(node, name) for name in _DURATIONS}
    short = {name: value for name, value in seconds.items() if value is not None}
    shorthand = [Param(name, 0.0, "in seconds", -_YEARS, _YEARS) for name in short]
    rest = [param for param in PARAMETERS if param.name.rpartition(".")[0] not in short]
    declare(node, [*shorthand, *rest])
    values = values_of(node, rest)
    times = {name: _nanoseconds(name, short, values) for name in _DURATIONS}
    return _checked(_options(values, times))


def _options(values: Mapping[str, Any], times: Mapping[str, int]) -> ReplayOptions:
    return ReplayOptions(
        recording=Path(values["recording"]).expanduser(),
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
        filter=_filter(values),
        qos_overrides=_path(values["play.qos_profile_overrides_path"]),
        window=values["play.read_ahead_queue_size"],
        acked_timeout=times["play.wait_acked_timeout"],
    )


def _checked(options: ReplayOptions) -> ReplayOptions:
    if options.recording == Path():
        raise RequestError("recording", "", "an MCAP file or the folder of a rosbag2 MCAP bag")
    if options.restamp and options.rate != 1.0:
        raise RequestError("play.rate", options.rate, "1.0, or restamp false: restamped messages keep their pace")
    for name, value in (("play.start_offset", options.range.offset), ("play.delay", options.delay)):
        if value < 0:
            raise RequestError(name, value / SECOND, "0 s or more")
    return options


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


def _matches(regex: str, topic: str) -> bool:
    return bool(regex) and re.fullmatch(regex, topic) is not None


def _nanoseconds(name: str, short: Mapping[str, Any], values: Mapping[str, Any]) -> int:
    """rosbag2's rule: the parts' sizes add up, and one negative part makes the whole negative."""
    if name in short:
        return round(float(short[name]) * SECOND)
    seconds, rest = values[f"{name}.sec"], values[f"{name}.nsec"]
    size: int = abs(seconds) * SECOND + abs(rest)
    return -size if seconds < 0 or rest < 0 else size


def _limit(time: int) -> int | None:
    return None if time < 0 else time


def _path(text: str) -> Path | None:
    return Path(text).expanduser() if text else None
