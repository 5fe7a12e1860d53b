"""Where the push_validator that runs beside a node writes: its parameter `output`."""

from __future__ import annotations

from pathlib import Path
from time import monotonic

from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.task import Future

from push_predictor.errors import RecordingError

PATIENCE = 3.0  # s that a validator has to be found, and to answer


class ValidatorFolder:
    """Asks the push_validator of the node's namespace: `ask`, then `work` until it answers."""

    def __init__(self, node: Node) -> None:
        self._client = node.create_client(GetParameters, "push_validator/get_parameters")
        self._asked: Future | None = None
        self._begun = 0.0

    def ask(self) -> None:
        """Begin anew."""
        self._asked, self._begun = None, monotonic()

    def work(self) -> Path | None:
        """The folder, None while there is no answer. Raises RecordingError if there will be none."""
        if self._asked is None and self._client.service_is_ready():
            self._asked = self._client.call_async(GetParameters.Request(names=["output"]))
        if self._asked is not None and self._asked.done():
            return _folder(self._asked.result())
        if monotonic() - self._begun > PATIENCE:
            raise RecordingError(f"no push_validator {'runs' if self._asked is None else 'answers'}")
        return None


def _folder(response: GetParameters.Response) -> Path:
    if not response.values or not response.values[0].string_value:
        raise RecordingError("the parameter output of push_validator is empty")
    return Path(response.values[0].string_value).expanduser().absolute()
