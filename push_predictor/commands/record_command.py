# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""push_predictor record: write the streams of a rig into a bag, without rosbag2."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

from push_predictor.commands.common.command import Option, command
from push_predictor.commands.common.options import RIG, SAVED_TOPICS, out_option, topics_of
from push_predictor.commands.common.output import write_json
from push_predictor.errors import PushPredictorError

if TYPE_CHECKING:
    from push_predictor.online.recorder_progress import Progress

NOTHING = "No message arrived. No bag was written."


@command(
    "record",
    "Record the topics of a rig into an MCAP bag. Shows the push windows found so far, the share of contact, gaps "
    "and what is missing. Ctrl-C ends the recording.",
    "push_predictor record --rig rig.yaml --slider-topic /vicon/block/block --out monday",
    out_option("the bag, a folder or FILE.mcap", lambda path: path.suffix != ".mcap"),
    RIG,
    SAVED_TOPICS,
    Option(
        "--duration", type=float, default=0.0, metavar="T", help="duration in s: end this long after the first message"
    ),
    Option(
        "--use-sim-time", action="store_true", help="the log time is that of /clock, as of a replay or a simulation"
    ),
)
def run(options: argparse.Namespace) -> None:
    """Record until Ctrl-C. Raises PushPredictorError without ROS, SystemExit where the recording fails."""
    try:
        summary = _recorded(options)
    except KeyboardInterrupt:  # before the node handles signals
        summary = None
    if not write_json(options, summary.to_json() if summary else {"recording": None}):
        print(summary.to_text() if summary else NOTHING)


def _recorded(options: argparse.Namespace) -> Progress | None:
    try:
        from push_predictor.nodes.push_recorder import record
    except ImportError as error:
        raise PushPredictorError(f"ROS 2 is needed to record ({error}); see push_predictor doctor") from None
    status, summary = record(["--ros-args", *_parameters(options)])
    if status:
        sys.exit(status)
    return summary


def _parameters(options: argparse.Namespace) -> Iterator[str]:
    """The options as arguments of the node."""
    from push_predictor.recordings.topics import values_of

    topics = values_of(topics_of(options))
    values: dict[str, object] = {"bag": str(options.out), "force": options.force, "duration": options.duration}
    values |= {key: value or [""] if isinstance(value, list) else value for key, value in topics.items()}
    values |= {"rig": "" if options.rig is None else str(options.rig), "use_sim_time": options.use_sim_time}
    for name, value in values.items():
        yield from ("-p", f"{name}:={json.dumps(value)}")
