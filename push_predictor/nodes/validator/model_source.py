# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The models of a validator: files, or names that predict_server knows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from time import monotonic

from rclpy.node import Node
from rclpy.task import Future

from push_predictor.errors import ModelFileError, RequestError
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor_interfaces.srv import ListModels

PAUSE = 1.0  # s after an answer that does not settle everything
PATIENCE = 5.0  # s after which an unanswered request is sent again


class ModelSource:
    """Loads models: files at once, names once the server reports where their files are.

    wanted: paths or names, the main model first; an empty text is the server's default model. Raises ModelFileError for
    a file that is no model, RequestError for two files whose models have the same name.
    """

    def __init__(self, node: Node, wanted: Sequence[str]) -> None:
        self._wanted = list(dict.fromkeys(wanted))
        self._files = {text: Path(text).expanduser().resolve() for text in self._wanted if _is_path(text)}
        loaded = {text: load_model(path) for text, path in self._files.items()}
        self._found = {text: (model.name, model) for text, model in loaded.items()}
        self._client = node.create_client(ListModels, "list_models")
        self._request: Future | None = None
        self._next = 0.0
        self.problems: list[str] = []
        names = [model.name for model in loaded.values()]
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise RequestError("compare", repeated, "model files whose models have different names")

    def models(self) -> dict[str, PushModel] | None:
        """All wanted models by the name to request, or None while some are unknown."""
        if len(self._found) < len(self._wanted):
            return None
        return dict(self._found[text] for text in self._wanted)

    @property
    def missing(self) -> str:
        """In words, which models are not known, empty if all are."""
        if self.models() is not None:
            return ""
        return " ".join(self.problems) or "Waiting for list_models of predict_server."

    def work(self) -> None:
        """Request the server's list until it settles everything. Call it often, in the executor's thread."""
        now = monotonic()
        if self._request is not None and self._request.done():
            self._take(self._request.result())
            self._request, self._next = None, now + PAUSE if self.problems else inf
        if now < self._next or not self._client.service_is_ready():
            return
        if self._request is not None:  # the server went away in between
            self._client.remove_pending_request(self._request)
        self._request, self._next = self._client.call_async(ListModels.Request()), now + PATIENCE

    def _take(self, response: ListModels.Response) -> None:
        files = {info.name: info.file for info in response.models}
        self.problems = [
            problem for text in self._wanted if (problem := self._settle(text, files, response.default_model))
        ]

    def _settle(self, text: str, files: Mapping[str, str], default: str) -> str:
        """In words, what is wrong with a wanted model, empty if nothing."""
        if text in self._files:
            return self._difference(self._found[text][0], self._files[text], files)
        name = text or default
        if text in self._found:
            return ""
        if not files.get(name):
            known = ", ".join(files) or "none"
            return f"predict_server has no model {name!r}. Its models: {known}. Call load_model, or set model."
        try:
            self._found[text] = (name, load_model(Path(files[name])))
        except ModelFileError as error:
            return f"Model {name!r} of predict_server cannot be loaded: {error}"
        return ""

    def _difference(self, name: str, path: Path, files: Mapping[str, str]) -> str:
        if name not in files:
            return f"predict_server has not loaded model {name!r} of {path}. Call load_model."
        if files[name] and Path(files[name]) != path:
            return f"predict_server loaded model {name!r} from {files[name]}, not from {path}."
        return ""


def _is_path(text: str) -> bool:
    return "/" in text or Path(text).is_file()
