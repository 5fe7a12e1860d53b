# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of push_replay: rosbag2's names under `play.`, times in seconds, and the node's own."""

from __future__ import annotations

from rclpy.node import Node

from push_predictor.nodes.parameters import Param, declare, values_of
from push_predictor.replay.options import ReplayOptions, replay_options

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


def read_options(node: Node) -> ReplayOptions:
    """Declare and read the parameters. Raises RequestError for a value that is not accepted."""
    declare(node, PARAMETERS)
    return replay_options(values_of(node, PARAMETERS))
