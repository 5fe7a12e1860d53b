# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A goal of an action, from a test."""

from __future__ import annotations

from typing import Any

import ros_harness as harness
from rclpy.action import ActionClient
from rclpy.node import Node

PATIENCE = 240.0  # s until a goal counts as stuck; a trace alone takes 3, beside eight busy processes it took over 60


class ActionGoal:
    """A goal that was sent: whether it was accepted, then its feedback so far, its status and result."""

    def __init__(self, node: Node, action: ActionClient, goal: Any) -> None:
        assert action.wait_for_server(harness.START_TIMEOUT)
        self.feedback: list[Any] = []
        sent = harness.in_spin(
            node, lambda: action.send_goal_async(goal, lambda message: self.feedback.append(message.feedback))
        )
        assert harness.wait_until(sent.done, PATIENCE)
        self.handle: Any = sent.result()
        self.accepted = bool(self.handle.accepted)
        if self.accepted:
            self._result = harness.in_spin(node, self.handle.get_result_async)

    @property
    def ended(self) -> bool:
        return bool(self._result.done())

    def end(self) -> tuple[int, Any]:
        assert harness.wait_until(self._result.done, PATIENCE), self.feedback
        return self._result.result().status, self._result.result().result
