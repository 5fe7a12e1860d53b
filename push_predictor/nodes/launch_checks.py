# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the launch files check before a node starts, and what they do when one ends.

launch is imported by the functions that need it: wheels from PyPI do not have it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_prefix

OF_LAUNCH = ("emulate_tty", "launch-prefix", "launch-prefix-filter", "sigkill_timeout", "sigterm_timeout")
YES, NO = ("true", "1", "yes"), ("false", "0", "no")
ENDED_BY_SIGNAL = (130, 143, -2, -15)  # SIGINT and SIGTERM, answered by the node, or by the kernel


def start_or_refuse(problem: str, make_nodes: Callable[[], list[Any]]) -> list[Any]:
    """The nodes, or with a problem an action that ends the launch with status 1 and states the problem."""
    if not problem:
        return make_nodes()
    from launch.actions import OpaqueFunction, TimerAction

    # From an event: an error while descriptions are read would leave the nodes of an including file without a parent.
    return [TimerAction(period=0.0, actions=[OpaqueFunction(function=_fail, args=[problem])])]


def argument_problem(file: str, words: Sequence[str], given: Mapping[str, str], switches: Sequence[str]) -> str:
    """What is wrong with the arguments of a launch file, empty if nothing.

    words: NAME:=VALUE of the command line. They are checked if it started this file: those of a file that includes it
    are not ours. given: every declared argument. switches: names of arguments that are true or false.
    """
    unknown = _unknown(words, tuple(given)) if started_directly(file, sys.argv) else []
    wrong = [
        f"{name}: {given[name]!r} is not accepted, give true or false"
        for name in switches
        if given[name].lower() not in (*YES, *NO)
    ]
    return "; ".join([*unknown, *wrong])


def started_directly(file: str, command: Sequence[str]) -> bool:
    """Whether a command line names this file: as a path, or as the file of this package."""
    name = Path(file).name
    return any(
        Path(word).name == name and (command[place - 1] == "push_predictor" or _same(word, file))
        for place, word in enumerate(command)
        if place > 0
    )


def executable_problem(package: str, argument: str) -> str:
    """How to install a package without which the argument cannot be obeyed, empty if it is installed."""
    try:
        if Path(get_package_prefix(package), "lib", package, package).exists():
            return ""
    except (PackageNotFoundError, OSError):  # OSError: no prefix at all is known
        pass
    return (
        f"{argument} needs the package {package}, which is not installed: "
        f"`sudo apt install ros-jazzy-{package}`, or leave {argument} out. Nothing was started"
    )


def is_true(text: str) -> bool:
    """Whether a switch is on."""
    return text.lower() in YES


def end_launch(*, also_if_done: bool = True) -> Callable[[Any, Any], Any]:
    """What to do when a node ends (on_exit): end the launch, with status 1 if the node failed.

    also_if_done: end it also if the node ended by itself with status 0.
    """

    def on_exit(event: Any, context: Any) -> Any:
        if event.returncode == 0:
            return _shutdown(f"{event.process_name} has ended") if also_if_done and not context.is_shutdown else None
        if context.is_shutdown and event.returncode in ENDED_BY_SIGNAL:
            return None
        # launch returns a status other than 0 only for an error of its own
        raise RuntimeError(f"{event.process_name} ended with status {event.returncode}: see its last messages")

    return on_exit


def _shutdown(reason: str) -> Any:
    from launch.actions import Shutdown

    return Shutdown(reason=reason)


def _fail(context: object, problem: str) -> None:
    raise RuntimeError(problem)


def _unknown(words: Sequence[str], accepted: Sequence[str]) -> list[str]:
    """A line for each word whose name is not accepted: the nearest name that is, or all."""
    names = [word.partition(":=")[0] for word in words if ":=" in word]
    lines = []
    for name in dict.fromkeys(names):
        if name not in (*accepted, *OF_LAUNCH):
            near = get_close_matches(name, accepted, n=1)
            wanted = repr(near[0]) if near else f"one of {', '.join(accepted)}"
            lines.append(f"launch argument {name!r} is not accepted, give {wanted}")
    return lines


def _same(word: str, file: str) -> bool:
    return Path(word).expanduser().resolve() == Path(file).resolve()
