"""An action whose goals are answered when their work is done, while the executor goes on with other things."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.node import Node


class DeferredAction(ActionServer):
    """Goals are executing from the moment they come, may be cancelled, and end with `finish`.

    A callback that waits would be polled by the executor without a pause. begin: called with every new goal.
    """

    def __init__(self, node: Node, action_type: Any, name: str, begin: Callable[[Any], None]) -> None:
        def accepted(goal: Any) -> None:
            goal.execute()
            begin(goal)

        self._untold: Any = None  # the last result, until somebody was sent it
        super().__init__(
            node,
            action_type,
            name,
            execute_callback=lambda goal: None,
            handle_accepted_callback=accepted,
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
        )

    @property
    def told(self) -> bool:
        """Whether the last result has been sent to somebody who asked for it."""
        return self._untold is None

    def notify_execute(self, goal_handle: Any, execute_callback: Any) -> None:
        """Do nothing: the work is done elsewhere."""

    def finish(self, goal: Any, end: Callable[[], None], result: Any) -> None:
        """Have the executor set the last state by `end` (goal.succeed, abort or canceled) and send the result."""

        def last(_: Any) -> Any:
            end()
            return result

        self._untold = result
        super().notify_execute(goal, last)

    def _send_result_response(self, request_header: Any, future: Any) -> None:
        super()._send_result_response(request_header, future)
        if future.result().result is self._untold:
            self._untold = None
