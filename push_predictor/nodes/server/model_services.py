# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The services list_models and load_model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from msg_adapters.model_infos import model_to_info
from push_predictor.errors import RequestError
from push_predictor.models.store.model_registry import ModelRegistry


def handle_list_models(registry: ModelRegistry, request: Any, response: Any) -> None:
    """Fill the response to ListModels."""
    names, default = registry.names, registry.default
    response.names, response.default_model = names, default
    response.descriptions = [registry.describe(name) for name in names]
    response.models = [
        model_to_info(name, registry.file(name), registry.get(name).model, name == default) for name in names
    ]
    response.success = True


def handle_load_model(registry: ModelRegistry, request: Any, response: Any) -> None:
    """Load the file and fill the response to LoadModel. Raises ModelFileError or RequestError; nothing changes then."""
    if not request.path:
        raise RequestError("path", request.path, "the path of a model file on the server's machine")
    response.name = registry.load(Path(request.path), request.name)
    how = registry.get(response.name).how
    response.success, response.message = True, f"{request.path} is loaded as {response.name!r}; {how}"
