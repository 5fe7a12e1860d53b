# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The service suggest_pushes: from a model and a robot's limits to the pushes to record next."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msg_adapters.suggestions import fill_suggest_response, query_from_suggest_request
from push_predictor.design.batch import suggest_pushes
from push_predictor.models.store.model_registry import ModelRegistry


def handle_suggest_pushes(
    check_cancelled: Callable[[], None], registry: ModelRegistry, request: Any, response: Any
) -> None:
    """Fill the response to SuggestPushes.

    check_cancelled: called before each push; it raises when the node ends. Raises RequestError.
    """
    query = query_from_suggest_request(request)
    suggested = suggest_pushes(
        registry.get(query.model).model,
        query.count,
        query.limits,
        covariates=query.covariates,
        seed=query.seed,
        check_cancelled=check_cancelled,
    )
    fill_suggest_response(response, suggested)
