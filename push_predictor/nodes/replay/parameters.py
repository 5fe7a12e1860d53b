# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of push_replay: rosbag2's names under `play.`, and the node's own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rclpy.node import Node

from push_predictor.errors import RequestError
from push_predictor.nodes.parameters import Param, declare, given_value, values_of
from push_predictor.replay.clock import SECOND
from push_predictor.replay.options import ReplayOptions, replay_options
from push_predictor.replay.rosbag2_parameters import check_given

_LONGEST = 1.0e10  # s, 300 years: longer than any stamp


def _duration(name: str, default: tuple[int, int], description: str) -> tuple[Param, Param]:
    """rosbag2's pair of integers; `name` itself, in seconds, is accepted instead."""
    return (
        Param(f"{name}.sec", default[0], f"{description}: seconds", -_LONGEST, _LONGEST),
        Param(f"{name}.nsec", default[1], f"{description}: nanoseconds in addition", -999_999_999, 999_999_999),
    )


SAVED = "Empty: as in NAME.recording.yaml"
PARAMETERS: tuple[Param, ...] = (
    Param(
        "recording",
        "",
        "recording to play: a rosbag2 folder, .mcap, .db3 or .bag file, or folder of CSV streams; or give storage.uri",
    ),
    Param("storage.uri", "", "another name of the parameter recording, that of rosbag2"),
    Param("storage.storage_id", "", "the format that the recording must have, mcap or sqlite3 (empty: any)"),
    Param("rig", "", "YAML file with the rig; it replaces the push_rig record of the recording"),
    Param("slider_topic", "", f"the slider's pose: TOPIC, TOPIC.FIELD or /tf:FRAME. {SAVED}, or slider/pose"),
    Param("pusher_topic", "", f"the pose of the pusher's tip, in the same manner. {SAVED}, or pusher/pose"),
    Param("wrench_topic", "", f"the wrench at the tip: TOPIC or TOPIC.FIELD. {SAVED}, or pusher/wrench"),
    Param("wrench_frame", "", f"axes of the wrench: world, tip or a frame of tf. {SAVED}, or world"),
    Param("world_frame", "", f"frame of the poses, into which tf turns others. {SAVED}, or their own"),
    Param("restamp", False, "add one constant offset to all header stamps so that they start now; requires rate 1"),
    Param(
        "spin_us",
        60,
        "busy-wait during the last microseconds of a wait, at most half of a short one: less lateness, more CPU",
        0,
        5000,
    ),
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
    *_duration("play.start_offset", (0, 0), "start this long after the first message"),
    *_duration("play.playback_duration", (-1, 0), "play this much of the recording (negative: all)"),
    *_duration("play.playback_until_timestamp", (0, -1), "play up to this log time (negative: to the end)"),
    *_duration("play.delay", (0, 0), "wait this long before playing, in each loop"),
    Param(
        "play.clock_publish_frequency",
        40.0,
        "/clock messages per second of wall time (0, the default of rosbag2: none)",
        0.0,
        1000.0,
    ),
    Param("play.clock_publish_on_topic_publish", False, "publish /clock with the log time before each message"),
    Param("play.clock_trigger_topics", [""], "topics before whose messages it does so (empty: all)"),
    Param("play.topics_to_filter", [""], "topics to play (empty: all)"),
    Param("play.regex_to_filter", "", "also play topics that match this regular expression"),
    Param("play.exclude_topics_to_filter", [""], "topics not to play"),
    Param("play.exclude_regex_to_filter", "", "do not play topics that match this regular expression"),
    Param("play.qos_profile_overrides_path", "", "YAML file {topic: {reliability, depth, ...}} as for ros2 bag play"),
    Param("play.read_ahead_queue_size", 1000, "messages to read ahead and sort by log time", 1, 1e6),
    *_duration(
        "play.wait_acked_timeout", (5, 0), "wait for acknowledgements at the end (0: no limit, negative: do not wait)"
    ),
)
_DURATIONS = tuple(param.name.removesuffix(".sec") for param in PARAMETERS if param.name.endswith(".sec"))


def read_options(node: Node) -> ReplayOptions:
    """Declare and read the parameters. Raises RequestError for a value, or a name, that is not accepted."""
    _check_names(node)
    seconds = {name: given_value(node, name) for name in _DURATIONS}
    short = {name: value for name, value in seconds.items() if value is not None}
    shorthand = [Param(name, 0.0, "in seconds", -_LONGEST, _LONGEST) for name in short]
    others = [param for param in PARAMETERS if param.name.rpartition(".")[0] not in short]
    declare(node, [*shorthand, *others])
    values = values_of(node, others)
    return replay_options(values, {name: _nanoseconds(name, short, values) for name in _DURATIONS})


def _check_names(node: Node) -> None:
    """Refuse unknown `play.*` and `storage.*`, which ROS would ignore silently."""
    given = {name: parameter.value for name, parameter in node._parameter_overrides.items()}
    defaults = {param.name: param.default for param in PARAMETERS}
    for name in _DURATIONS:
        pair = [part for part in (f"{name}.sec", f"{name}.nsec") if given.get(part, defaults[part]) != defaults[part]]
        if name in given and pair:
            raise RequestError(name, given[name], f"either {name} in seconds or {' and '.join(pair)}")
    without_effect = check_given(given, {param.name for param in PARAMETERS}.union(_DURATIONS))
    if without_effect:
        node.get_logger().info(f"without effect on this replay: {', '.join(without_effect)}")


def _nanoseconds(name: str, short: Mapping[str, Any], values: Mapping[str, Any]) -> int:
    """rosbag2's rule: the magnitudes of both parts add up, and one negative part makes the sum negative."""
    if name in short:
        return round(float(short[name]) * SECOND)
    seconds, nanoseconds = values[f"{name}.sec"], values[f"{name}.nsec"]
    size: int = abs(seconds) * SECOND + abs(nanoseconds)
    return -size if seconds < 0 or nanoseconds < 0 else size
