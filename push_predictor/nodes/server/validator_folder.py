"""Where the push_validator that runs beside a node writes: its parameter `output`."""

from __future__ import annotations

from pathlib import Path
from time import monotonic

from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.task import Future

from push_predictor.errors import RecordingError

PATIENCE = 5.0  # s that a validator has to be found, and to answer
AGAIN = 1.0  # s until it is asked again: the middleware drops an answer to a client that the validator has just met


class ValidatorFolder:
    """Asks the push_validator of the node's namespace: `ask`, then `work` until it answers."""

    def __init__(self, node: Node) -> None:
        self._client = node.create_client(GetParameters, "push_validator/get_parameters")
        self._asked: list[Future] = []
        self._begun = self._due = 0.0

    def ask(self) -> None:
        """Begin anew."""
        self._forget()
        self._begun = self._due = monotonic()

    def work(self) -> Path | None:
        """The folder, None while there is no answer. Raises RecordingError if there will be none."""
        now = monotonic()
        if now >= self._due and self._client.service_is_ready():
            self._asked.append(self._client.call_async(GetParameters.Request(names=["output"])))
            self._due = now + AGAIN
        for asked in self._asked:
            if asked.done():
                return _folder(asked.result())
        if now - self._begun > PATIENCE:
            raise RecordingError(f"no push_validator {'answers' if self._asked else 'runs'}")
        return None

    def _forget(self) -> None:
        for asked in self._asked:
            self._client.remove_pending_request(asked)
        self._asked.clear()


def _folder(response: GetParameters.Response) -> Path:
    if not response.values or not response.values[0].string_value:
        raise RecordingError("the parameter output of push_validator is empty")
    return Path(response.values[0].string_value).expanduser().absolute()
