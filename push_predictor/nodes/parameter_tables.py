# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of all nodes; the pages in docs/reference and the files in config/ repeat them."""

from __future__ import annotations

from collections.abc import Sequence

from push_predictor.adaptation.adaptation import USUAL
from push_predictor.evaluation.alarm.evidence import DEFAULT_RATE
from push_predictor.nodes.parameters import Param
from push_predictor.recordings.topic_settings import (
    STAMP,
    TOPICS,
    UP,
    WORLD_FRAME,
    WRENCH_BIAS,
    WRENCH_FRAME,
    Setting,
)
from push_predictor.resources import SHIPPED

LONGEST = 1.0e10  # s, 300 years: longer than any stamp
RIG = Param("rig", "", "Rig file (YAML, a push_rig record). Empty: the record on topic rig.")
STRICT = Param("strict", False, "Report a warning of the checks of the samples as an error in the diagnostics.")
FROM_FILE = "Empty: as in NAME.recording.yaml, or {}."
DIAGNOSTICS = Param("diagnostics_period", 1.0, "Seconds between two messages on /diagnostics.", low=0.1, high=60.0)


def _settings(settings: Sequence[Setting], tail: str = "Empty: {}.") -> tuple[Param, ...]:
    """Settings of the topics as parameters. tail: the last sentence of their descriptions, with the default."""
    return tuple(
        Param(each.name, "", f"{each.meaning}. {tail.format(each.default)}", true_text="y" if each is UP else "")
        for each in settings
    )


PREDICT_SERVER = (
    Param(
        "models",
        [SHIPPED],
        "Model files, and folders of them, to load on configuration. 'default' is the shipped model.",
    ),
    Param(
        "default_model",
        "",
        "Name of the model for requests that name none. Empty: the first one loaded.",
        read_only=False,
    ),
    Param("world_frame", "world", "Frame in which sliders lie flat, with z up."),
    Param("adapt", False, "Let the default model follow the rig from its activation, as NAME_adapted."),
    Param("adapt_mechanisms", list(USUAL), "Mechanisms whose parameters follow."),
    Param("autostart", True, "Configure and activate at start, without a lifecycle manager."),
    Param(
        "introspection",
        "disabled",
        "Service events on NAME/_service_event: none, metadata only, or metadata and contents.",
        choices=("disabled", "metadata", "contents"),
        read_only=False,
    ),
    DIAGNOSTICS,
    Param(
        "trace_alpha",
        0.01,
        "Largest probability that trace_residual reports an effect where there is none.",
        low=1e-6,
        high=0.5,
        read_only=False,
    ),
)

PUSH_RECORDER = (
    Param("bag", "", "Bag to write: a folder, or FILE.mcap. Required."),
    Param("force", False, "Replace a bag that exists."),
    RIG,
    *_settings(TOPICS, FROM_FILE),
    # Messages are recorded as they are; frames and bias are written into NAME.recording.yaml.
    *_settings((WRENCH_FRAME, WORLD_FRAME, WRENCH_BIAS, STAMP, UP), "Saved for the readers."),
    Param("covariate_topics", [""], "Further topics to record: TOPIC or TOPIC.FIELD."),
    Param("duration", 0.0, "Seconds after the first message at which the node ends. 0: at SIGINT.", low=0.0, high=1e9),
    DIAGNOSTICS,
)

PUSH_REPLAY = (
    Param("recording", "", "recording to play: a rosbag2 folder, .mcap, .db3 or .bag file, or folder of CSV streams"),
    Param("rig", "", "YAML file with the rig; it replaces the push_rig record of the recording"),
    *_settings((*TOPICS, WRENCH_FRAME, WORLD_FRAME, STAMP, UP), FROM_FILE),
    Param("wait_for_subscribers", 0.0, "longest wait in s until push topics and rig have subscribers", 0.0, 3600.0),
    Param("exit_when_finished", False, "end the process after the last message"),
    STRICT,
    Param("play.rate", 1.0, "recorded seconds per second of wall time", 1.0e-6, 1.0e6),
    Param("play.loop", False, "start again after the last message"),
    Param("play.start_paused", False, "start paused"),
    Param("play.start_offset", 0.0, "start so many s after the first message", 0.0, LONGEST),
    Param("play.playback_duration", -1.0, "play so many s of the recording (negative: all)", -LONGEST, LONGEST),
    Param("play.playback_until_timestamp", -1.0, "log time of the end, s (negative: none)", -LONGEST, LONGEST),
    Param("play.delay", 0.0, "wait so many s before playing, in each loop", 0.0, LONGEST),
    Param("play.clock_publish_frequency", 0.0, "/clock messages per second of wall time (0: none)", 0.0, 1000.0),
    Param("play.clock_publish_on_topic_publish", False, "publish /clock with the log time before each message"),
    Param("play.clock_trigger_topics", [""], "topics before whose messages it does so (empty: all)"),
    Param("play.topics_to_filter", [""], "topics to play (empty: all)"),
    Param("play.regex_to_filter", "", "also play topics that match this regular expression"),
    Param("play.exclude_topics_to_filter", [""], "topics not to play"),
    Param("play.exclude_regex_to_filter", "", "do not play topics that match this regular expression"),
    Param("play.read_ahead_queue_size", 1000, "messages to read ahead and sort by log time", 1, 1e6),
    Param("play.wait_acked_timeout", 5.0, "s to wait for acknowledgements at the end (0: no limit)", -1.0, LONGEST),
)

PUSH_VALIDATOR = (
    Param("model", "", "Model to validate: a model file, or a name known to predict_server. Empty: its default model."),
    Param("compare", [""], "Further models to validate on the same windows: files or names."),
    RIG,
    Param("output", "", "Folder for validation.json, windows.json, residuals and report. Empty: nothing is written."),
    Param("report", True, "Also write the HTML report when a recording has finished or ~/finish is called."),
    *_settings((*TOPICS, WRENCH_FRAME)),
    *_settings((WORLD_FRAME,), "Empty: world; others are rejected."),
    *_settings((STAMP, UP, WRENCH_BIAS)),
    Param("covariate_topics", [""], "Topics with a number: TOPIC or TOPIC.FIELD. Every window gets their values."),
    Param("request_timeout", 2.0, "Seconds after which an unanswered request is sent again.", low=0.05, high=60.0),
    Param("last_answers", 30.0, "Longest wait for missing answers after a recording, in s.", low=0.0, high=3600.0),
    Param("false_alarm_rate", DEFAULT_RATE, "Largest probability that push_alarm is ever published without a change."),
    STRICT,
    DIAGNOSTICS,
)
