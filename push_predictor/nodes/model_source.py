"""Which models a validator judges: a file, or a name that predict_server knows."""

from __future__ import annotations

from pathlib import Path

from push_predictor_interfaces.srv import ListModels
from rclpy.node import Node
from rclpy.task import Future

from push_predictor.errors import ModelFileError, RequestError
from push_predictor.models.model_file import load_model
from push_predictor.models.push_model import PushModel


class ModelSource:
    """Loads the models wanted: paths at once, names by asking the server where their files are.

    wanted: paths or names; an empty text is the server's default model. Raises ModelFileError for a bad file.
    """

    def __init__(self, node: Node, wanted: list[str]) -> None:
        self._wanted = wanted
        self._models: dict[str, PushModel] = {text: load_model(Path(text)) for text in wanted if _is_path(text)}
        self._client = node.create_client(ListModels, "list_models")
        self._asked: Future | None = None
        self.problem = ""

    def models(self) -> list[PushModel] | None:
        """All wanted models, or None while the server has not told about some of them."""
        if len(self._models) < len(set(self._wanted)):
            self._ask()
            return None
        return [self._models[text] for text in self._wanted]

    def _ask(self) -> None:
        if self._asked is None and self._client.service_is_ready():
            self._asked = self._client.call_async(ListModels.Request())
        if self._asked is not None and self._asked.done():
            response, self._asked = self._asked.result(), None
            self._learn(response)

    def _learn(self, response: ListModels.Response) -> None:
        files = {name: _file_of(text) for name, text in zip(response.names, response.descriptions, strict=False)}
        for text in self._wanted:
            name = text or response.default_model
            if text in self._models:
                continue
            try:
                if not files.get(name):
                    accepted = f"the path of a model file, or one of {', '.join(files) or 'none'}"
                    raise RequestError("model", name, accepted)
                self._models[text] = load_model(Path(files[name]))
            except (ModelFileError, RequestError) as error:
                self.problem = str(error)


def _is_path(text: str) -> bool:
    return "/" in text or Path(text).is_file()


def _file_of(description: str) -> str:
    parts = (part.partition("=") for part in description.split("; "))
    return next((value for key, _, value in parts if key == "file"), "")
