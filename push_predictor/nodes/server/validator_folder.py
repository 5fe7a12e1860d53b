# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The output folder of the push_validator in a node's namespace: that node's parameter `output`."""

from __future__ import annotations

from pathlib import Path
from time import monotonic

from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.task import Future

from push_predictor.errors import RecordingError

TIMEOUT = 5.0  # s to find a validator and to receive its answer
RETRY_PERIOD = 1.0  # s; the middleware drops an answer to a client that the validator has just discovered


class ValidatorFolder:
    """Asks a running push_validator for its output folder: `start`, then `poll` until it answers."""

    def __init__(self, node: Node) -> None:
        self._client = node.create_client(GetParameters, "push_validator/get_parameters")
        self._calls: list[Future] = []
        self._started = self._due = 0.0

    def start(self) -> None:
        """Start a new query."""
        self._forget()
        self._started = self._due = monotonic()

    def poll(self) -> Path | None:
        """The folder, None while there is no answer. Raises RecordingError after TIMEOUT."""
        now = monotonic()
        if now >= self._due and self._client.service_is_ready():
            self._calls.append(self._client.call_async(GetParameters.Request(names=["output"])))
            self._due = now + RETRY_PERIOD
        for call in self._calls:
            if call.done():
                return _folder(call.result())
        if now - self._started > TIMEOUT:
            raise RecordingError(f"no push_validator {'answers' if self._calls else 'runs'}")
        return None

    def _forget(self) -> None:
        for call in self._calls:
            self._client.remove_pending_request(call)
        self._calls.clear()


def _folder(response: GetParameters.Response) -> Path:
    if not response.values or not response.values[0].string_value:
        raise RecordingError("the parameter output of push_validator is empty")
    return Path(response.values[0].string_value).expanduser().absolute()
