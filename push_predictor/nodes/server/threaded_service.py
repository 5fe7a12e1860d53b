# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A service with its own thread: its answers do not wait for the executor.

rclpy's executor builds a new wait set from all entities of its nodes at each turn, and takes two turns per request. For
a node with twenty services that takes as long as a prediction. Here a thread waits for one service only, as
rclpy.wait_for_message waits for one topic.
"""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.service import Service

from push_predictor.nodes.polling import NoExecutor, not_called, take_request

JOIN_TIMEOUT = 5.0  # s
RETRY_DELAY = 0.1  # s after an error


class ThreadedService:
    """A service of a node whose callback runs in its own thread, in parallel with the node's other callbacks.

    The node lists it among its services, but its executor ignores it. Requests queue until `start`.
    """

    def __init__(
        self, node: Node, kind: Any, name: str, callback: Callable[[Any, Any], Any], qos_profile: QoSProfile
    ) -> None:
        self._node, self._closing = node, threading.Event()
        self.service: Service = node.create_service(
            kind, name, callback, qos_profile=qos_profile, callback_group=(apart := NoExecutor())
        )
        self._wake = node.create_guard_condition(not_called, apart)
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Answer requests from now on; a second call has no effect."""
        if not self._thread.is_alive():
            self._thread.start()

    def close(self) -> None:
        """Answer the requests that have arrived, end the thread and destroy the service."""
        self._closing.set()
        if self._thread.is_alive():
            self._wake.trigger()
            self._thread.join(JOIN_TIMEOUT)
        self._node.destroy_guard_condition(self._wake)
        self._node.destroy_service(self.service)

    def _run(self) -> None:
        context = self._node.context
        with ExitStack() as handles:
            for handle in (context.handle, self.service.handle, self._wake.handle):
                handles.enter_context(handle)
            # Not public, and without a public equal: an executor costs three turns of all entities for each request.
            wait_set = rclpy_implementation.WaitSet(0, 1, 0, 0, 1, 0, context.handle)
            while context.ok() and not self._closing.is_set():
                try:
                    self._wait(wait_set)
                    self._answer()
                except Exception:  # without its thread the service would exist and never answer
                    self._node.get_logger().error(traceback.format_exc())
                    self._closing.wait(RETRY_DELAY)
            while context.ok() and self._answer():
                pass

    def _wait(self, wait_set: Any) -> None:
        """Wait for a request or for `close`."""
        wait_set.clear_entities()
        wait_set.add_service(self.service.handle)
        wait_set.add_guard_condition(self._wake.handle)
        wait_set.wait(-1)

    def _answer(self) -> bool:
        """Answer one request; False if none has arrived."""
        request, header = take_request(self.service)
        if header is None:
            return False
        response = self.service.callback(request, self.service.srv_type.Response())
        self.service.send_response(response, header)
        return True
