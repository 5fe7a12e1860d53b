# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Substitutes for the few names of launch and launch_ros that the launch files use.

Both cannot be installed together with the ROS wheels. The substitutes record what they are given.
"""

from __future__ import annotations

import runpy
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

NAMES = {
    "launch": ("LaunchContext", "LaunchDescription"),
    "launch.actions": ("DeclareLaunchArgument", "OpaqueFunction", "SetEnvironmentVariable", "Shutdown"),
    "launch_ros": (),
    "launch_ros.actions": ("Node",),
}


@dataclass
class FakeAction:
    """An action of launch that records its arguments."""

    args: tuple[Any, ...]
    kwargs: dict[str, Any] = field(default_factory=dict)


def install_fake_launch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make both packages importable until the end of the test."""
    for module, names in NAMES.items():
        made = ModuleType(module)
        vars(made).update({name: _fake_action(name) for name in names})
        monkeypatch.setitem(sys.modules, module, made)


def load_launch_file(path: Path) -> dict[str, Any]:
    """The names that a launch file defines."""
    return runpy.run_path(str(path))


def actions(launch_file: dict[str, Any]) -> list[FakeAction]:
    """What the launch file describes."""
    return list(launch_file["generate_launch_description"]().args[0])


def started(launch_file: dict[str, Any], given: dict[str, str]) -> list[FakeAction]:
    """The actions that its function returns for these launch arguments."""
    (opaque,) = (action for action in actions(launch_file) if type(action).__name__ == "OpaqueFunction")
    defaults = {name: value for name, value, _ in launch_file["ARGUMENTS"]}
    context = SimpleNamespace(launch_configurations={**defaults, **given})
    return list(opaque.kwargs["function"](context))


def _fake_action(name: str) -> type[FakeAction]:
    return type(
        name, (FakeAction,), {"__init__": lambda self, *args, **kwargs: FakeAction.__init__(self, args, kwargs)}
    )
