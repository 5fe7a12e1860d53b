# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What each setting of the streams' topics means: the words of parameters, launch arguments and options.

The fields of `topics.Topics` are named by the same KEYS. Imports nothing that takes time.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Setting:
    """A setting; default: what an empty one means."""

    name: str
    meaning: str
    default: str


TOPICS = (
    Setting("slider_topic", "The slider's pose: TOPIC, TOPIC.FIELD or /tf:FRAME", "slider/pose"),
    Setting("pusher_topic", "The pose of the pusher's tip, in the same manner", "pusher/pose"),
    Setting("wrench_topic", "The wrench at the tip: TOPIC or TOPIC.FIELD", "pusher/wrench"),
)
WRENCH_FRAME = Setting(
    "wrench_frame", "Axes of the wrench: world, tip for those of its pose, or a frame of tf", "world"
)
WRENCH_BIAS = Setting("wrench_bias", "Bias of the wrench: free_motion to estimate and subtract it, or none", "none")
WORLD_FRAME = Setting("world_frame", "Frame of all poses; tf turns others into it", "their own")
STAMP = Setting("stamp", "Time of a sample: header, or log for that of its receipt", "header")
UP = Setting(
    "up",
    "Axis of the poses' world that points up: x, y, z, -x, -y or -z; of single streams as in slider=y,wrench=y",
    "z",
)
