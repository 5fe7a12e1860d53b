# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the launch files share: how they describe their arguments, and what they do when a node ends.

launch is imported by the functions that need it: wheels from PyPI do not have it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from push_predictor.nodes.parameters import Param

TOPICS = {"slider_topic": "slider/pose", "pusher_topic": "pusher/pose", "wrench_topic": "pusher/wrench"}
STREAMS = (*TOPICS, "wrench_frame", "wrench_bias", "world_frame", "stamp", "up")

SWITCH = ("true", "false", "True", "False")  # choices of an argument
ENDED_BY_SIGNAL = (130, 143, -2, -15)  # SIGINT and SIGTERM, answered by the node, or by the kernel


def stream_arguments(node: Sequence[Param]) -> tuple[tuple[str, str, str], ...]:
    """Name, default and description of the arguments that a node has as parameters of the same names: STREAMS."""
    return tuple((param.name, "", param.description) for param in node if param.name in STREAMS)


def description(
    arguments: Sequence[tuple[str, str, str]],
    choices: Mapping[str, Sequence[str]],
    nodes: Callable[[Any], Sequence[Any]],
) -> Any:
    """The launch description with these arguments: name, default, description. nodes: returns what is started."""
    from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable

    from launch import LaunchDescription

    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text, choices=choices.get(name))
        for name, value, text in arguments
    ]
    discovery = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    limited = SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", discovery)
    return LaunchDescription([*declared, limited, OpaqueFunction(function=nodes)])


def require_package(name: str, argument: str) -> None:
    """Raise RuntimeError that names the apt package if a package that an argument needs is not installed."""
    from ament_index_python.packages import PackageNotFoundError, get_package_prefix

    try:
        get_package_prefix(name)
    except (PackageNotFoundError, OSError):  # OSError: AMENT_PREFIX_PATH is not set
        apt = f"ros-jazzy-{name.replace('_', '-')}"
        raise RuntimeError(f"{argument} needs {name}, which is not installed: sudo apt install {apt}") from None


def is_true(text: str) -> bool:
    """Whether a switch is on."""
    return text.lower() == "true"


def end_launch(*, also_if_done: bool = True) -> Callable[[Any, Any], Any]:
    """What to do when a node ends (on_exit): end the launch, with status 1 if the node failed.

    also_if_done: end it also if the node ended by itself with status 0.
    """

    def on_exit(event: Any, context: Any) -> Any:
        from launch.actions import Shutdown

        if event.returncode == 0:
            reason = f"{event.process_name} has ended"
            return Shutdown(reason=reason) if also_if_done and not context.is_shutdown else None
        if context.is_shutdown and event.returncode in ENDED_BY_SIGNAL:
            return None
        # launch returns a status other than 0 only for an error of its own
        raise RuntimeError(f"{event.process_name} ended with status {event.returncode}: see its last messages")

    return on_exit
