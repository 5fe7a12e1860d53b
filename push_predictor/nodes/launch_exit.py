# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the launch files do when a node ends, and their switches.

launch is imported by the function that needs it: wheels from PyPI do not have it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

SWITCH = ("true", "false", "True", "False")  # choices of an argument
ENDED_BY_SIGNAL = (130, 143, -2, -15)  # SIGINT and SIGTERM, answered by the node, or by the kernel


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
