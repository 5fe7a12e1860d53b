# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of push_validator; the table in docs/reference/push_validator.md repeats them."""

from __future__ import annotations

from push_predictor.evaluation.alarm.evidence import DEFAULT_RATE
from push_predictor.nodes.parameters import Param

PARAMETERS = (
    Param("model", "", "Model to validate: a model file, or a name known to predict_server. Empty: its default model."),
    Param("compare", [""], "Further models to validate on the same windows: files or names."),
    Param("rig", "", "Rig file (YAML, a push_rig record). Empty: the record on topic rig."),
    Param("output", "", "Folder for validation.json, windows.json, residuals and report. Empty: nothing is written."),
    Param("report", True, "Also write the HTML report when a recording has finished or ~/finish is called."),
    Param("slider_topic", "", "The slider's pose: TOPIC, TOPIC.FIELD or /tf:FRAME. Empty: slider/pose."),
    Param("pusher_topic", "", "The pose of the pusher's tip, in the same manner. Empty: pusher/pose."),
    Param("wrench_topic", "", "The wrench at the tip: TOPIC or TOPIC.FIELD. Empty: pusher/wrench."),
    Param("wrench_frame", "", "Axes of the wrench: world, tip for those of its pose, or a frame of tf. Empty: world."),
    Param("wrench_bias", "", "Bias of the wrench: free_motion to estimate and subtract it, or none. Empty: none."),
    Param("world_frame", "", "Frame of all poses; tf turns others into it. Empty: world; others are rejected."),
    Param("covariate_topics", [""], "Topics with a number: TOPIC or TOPIC.FIELD. Every window gets their values."),
    Param("request_timeout", 2.0, "Seconds after which an unanswered request is sent again.", low=0.05, high=60.0),
    Param("last_answers", 30.0, "Longest wait for missing answers after a recording, in s.", low=0.0, high=3600.0),
    Param("false_alarm_rate", DEFAULT_RATE, "Largest probability that push_alarm is ever published without a change."),
    Param("strict", False, "Report a warning of the checks of the samples as an error in the diagnostics."),
    Param("diagnostics_period", 1.0, "Seconds between two messages on /diagnostics.", low=0.1, high=60.0),
)
