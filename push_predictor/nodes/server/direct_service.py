"""A service with a thread of its own: answered quickly, and while the executor is busy with something long.

rclpy's executor gathers every entity of its nodes into a new wait set at each turn, and takes two turns a request. For
a node with twenty services that is as much time as a prediction takes. Here one service is waited for, as
rclpy.wait_for_message waits for one topic.
"""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.service import Service

PATIENCE = 5.0  # s that the end waits for an answer
PAUSE = 0.1  # s after an error before it goes on


class DirectService:
    """A service of a node whose callback runs in a thread of its own, so beside the node's other callbacks.

    The node lists it among its services, but its executor leaves it alone. Requests wait until `begin`.
    """

    def __init__(
        self, node: Node, kind: Any, name: str, callback: Callable[[Any, Any], Any], qos_profile: QoSProfile
    ) -> None:
        self._node, self._ending = node, threading.Event()
        self.service: Service = node.create_service(
            kind, name, callback, qos_profile=qos_profile, callback_group=_NotTheExecutors()
        )
        with node.context.handle:
            self._wake = rclpy_implementation.GuardCondition(node.context.handle)
        self._thread = threading.Thread(target=self._serve, name=name, daemon=True)

    def begin(self) -> None:
        """Answer from now on; once."""
        if not self._thread.is_alive():
            self._thread.start()

    def close(self) -> None:
        """Answer what has arrived, end the thread, and take the service off the graph."""
        self._ending.set()
        if self._thread.is_alive():
            with self._wake:
                self._wake.trigger_guard_condition()
            self._thread.join(PATIENCE)
        self._wake.destroy_when_not_in_use()
        self._node.destroy_service(self.service)

    def _serve(self) -> None:
        context = self._node.context
        with ExitStack() as held:
            for handle in (context.handle, self.service.handle, self._wake):
                held.enter_context(handle)
            wait_set = rclpy_implementation.WaitSet(0, 1, 0, 0, 1, 0, context.handle)
            while context.ok() and not self._ending.is_set():
                try:
                    wait_set.clear_entities()
                    wait_set.add_service(self.service.handle)
                    wait_set.add_guard_condition(self._wake)
                    wait_set.wait(-1)
                    self._answer()
                except Exception:  # a thread that ended would leave a service that never answers
                    self._node.get_logger().error(traceback.format_exc())
                    self._ending.wait(PAUSE)
            while context.ok() and self._answer():
                pass

    def _answer(self) -> bool:
        """Answer a request if one waits; says whether one did."""
        request, header = self.service.handle.service_take_request(self.service.srv_type.Request)
        if header is None:
            return False
        response = self.service.callback(request, self.service.srv_type.Response())
        self.service.send_response(response, header)
        return True


class _NotTheExecutors(CallbackGroup):
    """Entities that no executor waits for."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        """Never begun."""
