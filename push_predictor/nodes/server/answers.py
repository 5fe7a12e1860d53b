"""From a shelf of models and a request to a response: what the services of predict_server do, without a graph.

Each function fills the response or raises a PushPredictorError that says what is wrong with the request.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from msg_adapters.predictions import (
    extend_batch_response,
    fill_response,
    push_from_request,
    query_from_batch_request,
)
from push_predictor.errors import PushPredictorError, RequestError
from push_predictor.models.push_model import Prediction
from push_predictor.models.request import check_request, check_requests
from push_predictor.models.store.model_registry import ModelRegistry
from push_predictor.models.tabulated.tabulated_model import TabulatedModel

MOST_PUSHES = 1_000_000  # of a batch: the server takes up to 0.6 kB for each while it answers
MOST_EXACT = 50_000  # of them outside a table: up to a millisecond each
ROWS_AT_ONCE = 4096  # of a batch, so that its length does not decide how much memory a prediction takes


class PredictionError(PushPredictorError):
    """A push was accepted, but what a model says of it is no number."""


def answer_push(shelf: ModelRegistry, request: Any, response: Any) -> None:
    """Answer PredictPush. Raises RequestError."""
    push = push_from_request(request)
    tabulated = shelf.get(request.model)
    check_request(tabulated.model, push)
    prediction = tabulated.predict_one(push)
    _check_finite(tabulated, prediction, 0)
    fill_response(response, prediction)


def answer_batch(go_on: Callable[[], None], shelf: ModelRegistry, request: Any, response: Any) -> None:
    """Answer PredictPushBatch; one bad push refuses all. go_on is called now and then and may raise.

    Raises RequestError.
    """
    if (count := len(request.velocity)) > MOST_PUSHES:
        raise RequestError("velocity length", count, f"at most {MOST_PUSHES} pushes a call")
    query = query_from_batch_request(request)
    tabulated = shelf.get(query.model)
    check_requests(tabulated.model, query.inputs, query.duration, query.covariates)
    if count > MOST_EXACT and (slow := tabulated.exact_count(query.inputs)) > MOST_EXACT:
        accepted = f"at most {MOST_EXACT} pushes that no table answers (docs/services.md) a call"
        raise RequestError("velocity length", f"{slow} pushes without a table", accepted)
    for start in range(0, len(query.inputs), ROWS_AT_ONCE):
        go_on()
        rows = slice(start, start + ROWS_AT_ONCE)
        inputs, covariates = query.inputs[rows], {name: column[rows] for name, column in query.covariates.items()}
        prediction = tabulated.predict_rows(inputs, np.full(len(inputs), query.duration), covariates)
        _check_finite(tabulated, prediction, start)
        extend_batch_response(response, prediction)
    response.success = True


def _check_finite(tabulated: TabulatedModel, prediction: Prediction, start: int) -> None:
    """Raise PredictionError for a push of which the model makes no number; start: the index of the first."""
    if prediction.in_domain.all():
        return  # between pushes that it was trained on a model has an answer
    known = np.isfinite(prediction.mean).all(axis=1) & np.isfinite(prediction.covariance).all(axis=(1, 2))
    if not known.all():
        index = start + int(np.flatnonzero(~known)[0])
        raise PredictionError(
            f"push {index}: {tabulated.model.name} has no finite answer, its velocity or a covariate is too far "
            "from what the model was trained on"
        )


def answer_list(shelf: ModelRegistry, response: Any) -> None:
    """Answer ListModels."""
    response.names = shelf.names
    response.descriptions = [shelf.describe(name) for name in response.names]
    response.default_model = shelf.default


def answer_load(shelf: ModelRegistry, request: Any, response: Any) -> None:
    """Answer LoadModel; the shelf changes only if the file is good. Raises ModelFileError or RequestError."""
    if not request.path:
        raise RequestError("path", request.path, "the path of a model file on the server's machine")
    response.name = shelf.load(Path(request.path), request.name)
    how = shelf.get(response.name).how
    response.success, response.message = True, f"{request.path} is loaded as {response.name!r}; {how}"
