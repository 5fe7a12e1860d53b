# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Start predict_server, push_validator and, for a recording, push_replay; with rviz:=true also RViz2.

ros2 launch push_predictor push_predictor.launch.py recording:=bags/square_abs_test model:=default

docs/how_to/visualisation.md describes what RViz2 displays.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from push_predictor.nodes.launch_files import (
    SWITCH,
    TOPICS,
    description,
    end_launch,
    is_true,
    require_package,
    stream_arguments,
)
from push_predictor.nodes.parameter_tables import PUSH_REPLAY, PUSH_VALIDATOR
from push_predictor.nodes.parameters import Param
from push_predictor.resources import DEFAULT_MODEL, SHIPPED

CHOICES = dict.fromkeys(("use_sim_time", "autostart", "adapt", "rviz"), SWITCH) | {
    "reliability": ("", "reliable", "best_effort")
}

# --8<-- [start:documented]
ARGUMENTS = (
    ("namespace", "", "Namespace of all nodes."),
    ("params_file", "", "YAML file with parameters, such as those in config/. Other arguments override it."),
    ("use_sim_time", "false", "Use the time on /clock. With a recording, the replay publishes it at 40 Hz."),
    ("log_level", "info", "debug, info, warn, error or fatal."),
    ("enclaves", "", "SROS 2: run each node in its enclave below this path (docs/how_to/security.md)."),
    ("autostart", "true", "Configure and activate predict_server; false: a lifecycle manager does that."),
    ("adapt", "false", "Let the model follow the rig, as NAME_adapted beside it."),
    ("recording", "", "Recording to replay: a folder, .mcap, .db3 or .bag file. Empty: none, the sensors are live."),
    ("model", "", "Model file to load and to validate, or default: the simulated one that ships with the package."),
    ("rate", "", "Recorded seconds per second. Empty: 1, or the value in params_file."),
    ("output", "", "Folder for the validator's results. Empty: nothing is written."),
    ("rig", "", "push_rig YAML file, for a recording without a push_rig record."),
    *stream_arguments(PUSH_VALIDATOR),
    ("covariate_topics", "", "Further topics with one number each, separated by commas: possible causes of a change."),
    ("reliability", "", "QoS of these subscriptions: reliable or best_effort. Empty: as the publishers offer it."),
    ("rviz", "false", "Open RViz2 with the package's configuration: slider, pusher and windows from above."),
    ("rviz_config", "", "RViz configuration file. Empty: the installed config/push_predictor.rviz."),
)
# --8<-- [end:documented]


def generate_launch_description() -> LaunchDescription:
    return description(ARGUMENTS, CHOICES, _nodes)


def _nodes(context: LaunchContext) -> list[Node]:
    given = {name: context.launch_configurations[name] for name, _, _ in ARGUMENTS}
    recording = given["recording"]
    nodes = [
        _node("predict_server", "push_predictor", given, _server(given), end_launch()),
        _node("push_validator", "push_validator", given, _validator(given), end_launch()),
    ]
    if recording:
        finished = end_launch(also_if_done=False)  # the validator goes on: it may be writing the results
        nodes.append(
            _node("push_replay", "push_replay", given, _replay(given, recording), finished, _replay_defaults(given))
        )
    if is_true(given["rviz"]):
        require_package("rviz2", "rviz:=true")
        nodes.append(_rviz(given))
    return nodes


def _server(given: dict[str, str]) -> dict[str, Any]:
    model = given["model"]
    models = {"models": [SHIPPED if model == SHIPPED else _path(model)]} if model else {}
    return {**models, **_switch(given, "autostart", default=True), **_switch(given, "adapt", default=False)}


def _validator(given: dict[str, str]) -> dict[str, Any]:
    paths = {name: _path(given[name]) for name in ("model", "output", "rig") if given[name]}
    if given["model"] == SHIPPED:
        paths["model"] = Path(DEFAULT_MODEL[-1]).stem  # its name at predict_server
    scalars = [topic.strip() for topic in given["covariate_topics"].split(",") if topic.strip()]
    found: dict[str, Any] = {**paths, **_streams(given, PUSH_VALIDATOR), **_qos(given)}
    return {**found, "covariate_topics": scalars} if scalars else found


def _streams(given: dict[str, str], node: Sequence[Param]) -> dict[str, str]:
    """Where the streams of pushes are, as far as it was given and the node has such parameters."""
    return {name: given[name] for name, _, _ in stream_arguments(node) if given[name]}


def _qos(given: dict[str, str]) -> dict[str, str]:
    """The override of the reliability for each sensor topic; frames of tf have none."""
    if not given["reliability"]:
        return {}
    topics = [given[name] or default for name, default in TOPICS.items()]
    names = [_full_name(given["namespace"], topic.partition(".")[0]) for topic in topics if ":" not in topic]
    return {f"qos_overrides.{name}.subscription.reliability": given["reliability"] for name in names}


def _full_name(namespace: str, topic: str) -> str:
    return topic if topic.startswith("/") else f"/{namespace}/{topic}".replace("//", "/")


def _replay(given: dict[str, str], recording: str) -> dict[str, Any]:
    rig = {"rig": _path(given["rig"])} if given["rig"] else {}
    rate = {"play.rate": float(given["rate"])} if given["rate"] else {}
    return {**rig, **rate, **_streams(given, PUSH_REPLAY), "recording": _path(recording)}


def _replay_defaults(given: dict[str, str]) -> dict[str, float]:
    """What differs from the node's own defaults, unless params_file says otherwise."""
    clock = {"play.clock_publish_frequency": 40.0} if is_true(given["use_sim_time"]) else {}
    return {**clock, "wait_for_subscribers": 30.0}  # without this wait the validator would miss the first pushes


def _node(
    executable: str,
    name: str,
    given: dict[str, str],
    parameters: dict[str, Any],
    on_exit: Callable[[Any, Any], Any],
    defaults: dict[str, float] | None = None,
) -> Node:
    """A node. Its parameters override those of params_file, and these the defaults."""
    files = [given["params_file"]] if given["params_file"] else []
    enclave = ["--enclave", f"{given['enclaves'].rstrip('/')}/{executable}"] if given["enclaves"] else []
    # As a dictionary they would be merged with the parameters, and override a file that names all nodes.
    first = [word for key, value in (defaults or {}).items() for word in ("-p", f"{key}:={value}")]
    return Node(
        package="push_predictor",
        executable=executable,
        name=name,
        namespace=given["namespace"],
        parameters=[*files, {**_switch(given, "use_sim_time", default=False), **parameters}],
        arguments=["--ros-args", "--log-level", given["log_level"], *first, *enclave],
        output="screen",
        on_exit=on_exit,
    )


def _rviz(given: dict[str, str]) -> Node:
    share = Path(__file__).resolve().parents[1]  # config/ is installed next to launch/
    config = _path(given["rviz_config"]) if given["rviz_config"] else str(share / "config" / "push_predictor.rviz")
    return Node(
        package="rviz2",
        executable="rviz2",
        name="rviz2",
        namespace=given["namespace"],  # its topics are relative
        parameters=[_switch(given, "use_sim_time", default=False)],
        arguments=["-d", config],
        output="screen",
    )


def _switch(given: dict[str, str], name: str, default: bool) -> dict[str, bool]:
    """The parameter if it differs from its default, so that params_file can set it otherwise."""
    value = is_true(given[name])
    return {} if value == default else {name: value}


def _path(text: str) -> str:
    return os.path.abspath(os.path.expanduser(text))
