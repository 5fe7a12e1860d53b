"""predict_server, push_replay and push_validator together, and RViz2 if wanted.

ros2 launch push_predictor push_predictor.launch.py recording:=bags/square_abs_test model:=square_abs.pushmodel
rviz:=true opens RViz2 beside them (docs/how_to/visualisation.md).
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription

ARGUMENTS = (
    ("namespace", "", "Namespace of all nodes."),
    ("params_file", "", "YAML file with parameters, such as those in config/; other arguments that are given win."),
    ("use_sim_time", "false", "Nodes take /clock, which the replay publishes, for their time."),
    ("log_level", "info", "debug, info, warn, error or fatal."),
    ("enclaves", "", "SROS 2: run each node in its enclave below this path (docs/how_to/security.md)."),
    ("autostart", "true", "Configure and activate predict_server; false leaves that to a lifecycle manager."),
    ("recording", "", "Recording to replay: rosbag2 folder or .mcap file; empty: none, sensors are live."),
    ("bag", "", "The same as recording."),
    ("model", "", "Model file to serve and to judge."),
    ("rate", "", "Recorded seconds per second; empty: 1, or what params_file says."),
    ("output", "", "Folder for the validator's results; empty: nothing is written."),
    ("rig", "", "push_rig YAML file, where the recording holds none."),
    ("rviz", "false", "Open RViz2 with the configuration of this package: slider, pusher, windows from above."),
    ("rviz_config", "", "RViz configuration file; empty: config/push_predictor.rviz as installed."),
)


def generate_launch_description() -> LaunchDescription:
    declared = [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in ARGUMENTS]
    discovery = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    return LaunchDescription(
        [
            *declared,
            SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", discovery),
            OpaqueFunction(function=_nodes),
        ]
    )


def _nodes(context: LaunchContext) -> list[Node]:
    given = {name: context.launch_configurations[name] for name, _, _ in ARGUMENTS}
    recording = given["recording"] or given["bag"]
    nodes = [
        _node("predict_server", "push_predictor", given, _server(given)),
        _node("push_validator", "push_validator", given, _validator(given)),
    ]
    if recording:
        nodes.append(_node("push_replay", "push_replay", given, _replay(given, recording)))
    if _true(given["rviz"]):
        nodes.append(_rviz(given))
    return nodes


def _server(given: dict[str, str]) -> dict[str, Any]:
    models = {"models": [_path(given["model"])]} if given["model"] else {}
    return {**models, **_switch(given, "autostart", default=True)}


def _validator(given: dict[str, str]) -> dict[str, Any]:
    return {name: _path(given[name]) for name in ("model", "output", "rig") if given[name]}


def _replay(given: dict[str, str], recording: str) -> dict[str, Any]:
    rig = {"rig": _path(given["rig"])} if given["rig"] else {}
    rate = {"play.rate": float(given["rate"])} if given["rate"] else {}
    # A replay that began before the validator listens would lose its first pushes.
    return {**rig, **rate, "recording": _path(recording), "wait_for_subscribers": 30.0}


def _node(executable: str, name: str, given: dict[str, str], parameters: dict[str, Any]) -> Node:
    files = [given["params_file"]] if given["params_file"] else []
    enclave = ["--enclave", f"{given['enclaves'].rstrip('/')}/{executable}"] if given["enclaves"] else []
    return Node(
        package="push_predictor",
        executable=executable,
        name=name,
        namespace=given["namespace"],
        parameters=[*files, {**_switch(given, "use_sim_time", default=False), **parameters}],
        arguments=["--ros-args", "--log-level", given["log_level"], *enclave],
        output="screen",
    )


def _rviz(given: dict[str, str]) -> Node:
    share = Path(__file__).resolve().parents[1]  # this file is installed beside config/
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
    """The parameter if it is not at its default, so that params_file may say otherwise."""
    value = _true(given[name])
    return {} if value == default else {name: value}


def _true(text: str) -> bool:
    return text.lower() in ("true", "1", "yes")


def _path(text: str) -> str:
    return os.path.abspath(os.path.expanduser(text))
