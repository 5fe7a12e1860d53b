# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Start push_recorder, which writes the streams of a rig into a bag.

ros2 launch push_predictor record.launch.py bag:=monday rig:=rig.yaml slider_topic:=/vicon/block/block

docs/how_to/your_own_data.md describes it.
"""

from __future__ import annotations

import os
from typing import Any

from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from push_predictor.nodes.launch_files import STREAMS, SWITCH, description, end_launch, is_true, stream_arguments
from push_predictor.nodes.parameter_tables import PUSH_RECORDER

PATHS = ("bag", "rig")
SWITCHES = ("force", "use_sim_time")
# --8<-- [start:documented]
ARGUMENTS = (
    ("namespace", "", "Namespace of the node."),
    ("params_file", "", "YAML file with parameters, such as config/push_recorder.yaml. Other arguments override it."),
    ("use_sim_time", "false", "The log time is that of /clock, as of a replay or a simulation."),
    ("log_level", "info", "debug, info, warn, error or fatal."),
    (
        "enclave",
        "",
        "SROS 2: the enclave of the node, such as /push_predictor/push_recorder (docs/how_to/security.md).",
    ),
    ("bag", "", "Bag to write: a folder, or FILE.mcap."),
    ("force", "false", "Replace a bag that exists."),
    ("rig", "", "push_rig YAML file to record. Empty: the record on topic rig."),
    *stream_arguments(PUSH_RECORDER),
    ("covariate_topics", "", "Further topics to record, separated by commas."),
    ("duration", "", "Seconds after the first message at which the node ends. Empty: at Ctrl-C."),
)
# --8<-- [end:documented]


def generate_launch_description() -> LaunchDescription:
    return description(ARGUMENTS, dict.fromkeys(SWITCHES, SWITCH), _nodes)


def _nodes(context: LaunchContext) -> list[Node]:
    given = {name: context.launch_configurations[name] for name, _, _ in ARGUMENTS}
    enclave = ["--enclave", given["enclave"]] if given["enclave"] else []
    files = [given["params_file"]] if given["params_file"] else []
    recorder = Node(
        package="push_predictor",
        executable="push_recorder",
        name="push_recorder",
        namespace=given["namespace"],
        parameters=[*files, _parameters(given)],
        arguments=["--ros-args", "--log-level", given["log_level"], *enclave],
        output="screen",
        sigterm_timeout="30",  # a large bag needs time to be completed
        on_exit=end_launch(),
    )
    return [recorder]


def _parameters(given: dict[str, str]) -> dict[str, Any]:
    """The arguments that were given: others keep the value of params_file."""
    found: dict[str, Any] = {name: given[name] for name in STREAMS if given[name]}
    found |= {name: os.path.abspath(os.path.expanduser(given[name])) for name in PATHS if given[name]}
    found |= {name: True for name in SWITCHES if is_true(given[name])}
    if given["covariate_topics"]:
        found["covariate_topics"] = [topic.strip() for topic in given["covariate_topics"].split(",")]
    return found | ({"duration": float(given["duration"])} if given["duration"] else {})
