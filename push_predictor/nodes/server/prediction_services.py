# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The services predict_push and predict_push_batch: from a request and the loaded models to a response.

A handler fills the response, or raises a PushPredictorError that states what is wrong with the request.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from msg_adapters.predictions import (
    PushQuery,
    extend_batch_response,
    fill_response,
    push_from_request,
    query_from_batch_request,
    residual_from_request,
)
from push_predictor.errors import PredictionError, TooLargeError
from push_predictor.models.prediction import NOT_FINITE, Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.request import (
    PushRequest,
    check_request,
    check_requests,
    domain_remark,
    own_window,
    with_own_window,
)
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.tabulated.tabulated_model import TabulatedModel
from push_predictor.planning.given_earlier import EarlierWindows, given_earlier
from push_predictor.planning.persistence import persistence_of
from push_predictor.types import Array

MAX_PUSHES = 1_000_000  # per batch: the server needs up to 0.6 kB for each while it answers
MAX_EXACT = 50_000  # of these outside a table: up to a millisecond each
CHUNK = 4096  # rows predicted at once: the length of a batch must not determine the memory of a prediction


def handle_predict_push(registry: ModelRegistry, request: Any, response: Any) -> None:
    """Fill the response to PredictPush. Raises RequestError or PredictionError."""
    asked, residual = push_from_request(request), residual_from_request(request)
    tabulated = registry.get(request.model)
    push = with_own_window(tabulated.model, asked)
    check_request(tabulated.model, push)
    arrays = push.arrays
    prediction = tabulated.predict_rows(*arrays)
    _check_finite(tabulated, prediction, 0)
    if residual is not None:
        prediction = _given_residual(tabulated.model, push, prediction, residual)
    fill_response(response, prediction)
    if not response.in_domain:
        response.message = domain_remark(tabulated.model, Push(*arrays), prediction.in_domain)


def handle_predict_push_batch(
    check_cancelled: Callable[[], None], registry: ModelRegistry, request: Any, response: Any
) -> None:
    """Fill the response to PredictPushBatch; one bad push refuses the whole batch.

    check_cancelled: called before each chunk; it raises when the node ends. Raises RequestError or PredictionError.
    """
    if (count := len(request.velocity)) > MAX_PUSHES:
        raise TooLargeError("velocity length", count, f"at most {MAX_PUSHES} pushes a call")
    asked = query_from_batch_request(request)
    tabulated = registry.get(asked.model)
    query, inside = replace(asked, duration=own_window(tabulated.model, asked.duration)), [np.ones(0, dtype=np.bool_)]
    check_requests(tabulated.model, query.inputs, query.duration, query.covariates)
    _check_exact(tabulated, query)
    for start in range(0, count, CHUNK):
        check_cancelled()
        rows = slice(start, start + CHUNK)
        inputs, covariates = query.inputs[rows], {name: column[rows] for name, column in query.covariates.items()}
        prediction = tabulated.predict_rows(inputs, np.full(len(inputs), query.duration), covariates)
        _check_finite(tabulated, prediction, start)
        extend_batch_response(response, prediction)
        inside.append(prediction.in_domain)
    pushes = Push(query.inputs, np.full(count, query.duration), query.covariates)
    response.message = domain_remark(tabulated.model, pushes, np.concatenate(inside))
    response.success = True


def _given_residual(model: PushModel, push: PushRequest, prediction: Prediction, residual: Array) -> Prediction:
    """The prediction for the next window of a push, given the residuals (k, 3) of the windows before, oldest first.

    These windows are taken to follow one another, with the same prediction, speed and duration.
    """
    k = len(residual)
    same = Prediction(
        prediction.mean.repeat(k, axis=0),
        prediction.covariance.repeat(k, axis=0),
        prediction.process_covariance.repeat(k, axis=0),
        prediction.in_domain.repeat(k),
    )
    distance = push.velocity * push.duration * np.arange(k, 0, -1, dtype=np.float64)
    return given_earlier(prediction, EarlierWindows(same, same.mean + residual, distance), persistence_of(model))


def _check_exact(tabulated: TabulatedModel, query: PushQuery) -> None:
    """Raise TooLargeError if too many pushes need the model itself, not its table."""
    if len(query.inputs) > MAX_EXACT and (count := tabulated.exact_count(query.inputs)) > MAX_EXACT:
        accepted = f"at most {MAX_EXACT} pushes a call without a table (docs/reference/predict_server.md)"
        raise TooLargeError("velocity length", f"{count} pushes without a table", accepted)


def _check_finite(tabulated: TabulatedModel, prediction: Prediction, start: int) -> None:
    """Raise PredictionError for the first push without a finite prediction; start: index of the chunk's first push."""
    if (bad := prediction.first_not_finite) is not None:
        raise PredictionError(f"push {start + bad}: {tabulated.model.name} has no finite prediction: {NOT_FINITE}")
