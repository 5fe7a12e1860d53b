# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""An action server whose goals end when work elsewhere is done; the executor stays free meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node


class DeferredAction(ActionServer):
    """Goals execute from their arrival, can be cancelled, and end with `finish`.

    An execute callback that waits would make the executor poll it without a pause. accepts: whether a goal that arrives
    now is accepted. begin: called with every accepted goal.
    """

    def __init__(
        self, node: Node, action_type: Any, name: str, accepts: Callable[[], bool], begin: Callable[[Any], None]
    ) -> None:
        def accepted(goal: Any) -> None:
            goal.execute()
            begin(goal)

        self._unsent: Any = None  # the last result, until it has been sent to a client
        super().__init__(
            node,
            action_type,
            name,
            execute_callback=lambda goal: None,
            goal_callback=lambda request: GoalResponse.ACCEPT if accepts() else GoalResponse.REJECT,
            handle_accepted_callback=accepted,
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
        )

    @property
    def result_sent(self) -> bool:
        """Whether the last result has been sent to a client that requested it."""
        return self._unsent is None

    def notify_execute(self, goal_handle: Any, execute_callback: Any) -> None:
        """Do nothing: the work is done elsewhere."""

    def finish(self, goal: Any, end: Callable[[], None], result: Any) -> None:
        """Let the executor set the final state with `end` (goal.succeed, abort or canceled) and send the result."""

        def last(_: Any) -> Any:
            end()
            return result

        self._unsent = result
        super().notify_execute(goal, last)

    def _send_result_response(self, request_header: Any, future: Any) -> None:
        super()._send_result_response(request_header, future)
        if future.result().result is self._unsent:
            self._unsent = None
