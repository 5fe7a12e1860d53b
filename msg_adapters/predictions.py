# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""PredictPush, PredictPushBatch and SuggestPushes: pushes and limits <-> requests, results <-> responses."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.design.limits import Interval, Limits
from push_predictor.error_codes import ErrorCode
from push_predictor.errors import CovariateError, PushPredictorError, RequestError
from push_predictor.models.prediction import Prediction
from push_predictor.models.request import PushRequest
from push_predictor.types import Array
from push_predictor_interfaces.srv import PredictPush, PredictPushBatch

if TYPE_CHECKING:
    from push_predictor.design.batch import Suggested


class RefusedError(PushPredictorError):
    """The server answered success=false; the text is its message."""


MOST_EARLIER = 10  # windows of a push under way; none further apart were compared for what persists


@dataclass(frozen=True, eq=False)
class PushQuery:
    """n pushes to predict by one model.

    inputs (n, 3): velocity m/s, contact, angle rad. duration: s, of all. covariates: (n,) by name. model: a name, empty
    for the default one.
    """

    model: str
    inputs: Array
    duration: float
    covariates: dict[str, Array]


def query_to_request(
    model: str,
    push: Array,
    duration: float,
    covariates: Mapping[str, float] | None = None,
    residual: Array | None = None,
) -> PredictPush.Request:
    """The request for one push (3,). residual (3,) or (k, 3): of the windows before, oldest first, m, m, rad."""
    request = PredictPush.Request(model=model, duration=float(duration))
    request.velocity, request.contact, request.angle = (float(value) for value in push)
    request.covariate_names = list(covariates or {})
    request.covariate_values = [float(value) for value in (covariates or {}).values()]
    request.push_residual = [] if residual is None else doubles(residual)
    return request


def query_to_batch_request(query: PushQuery) -> PredictPushBatch.Request:
    """The request for n pushes."""
    request = PredictPushBatch.Request(model=query.model, duration=float(query.duration))
    request.velocity, request.contact, request.angle = map(doubles, query.inputs.T)
    request.covariate_names = list(query.covariates)
    request.covariate_values = doubles(_push_by_push(query.covariates))
    return request


def push_from_request(request: Any) -> PushRequest:
    """The push that a PredictPush request describes. Raises RequestError unless each covariate has one value."""
    covariates = covariates_of_push(request)
    return PushRequest(request.velocity, request.contact, request.angle, request.duration, covariates)


def residual_from_request(request: Any) -> Array | None:
    """Residuals (k, 3) of the k windows before, oldest first, m, m, rad; None for none. Raises RequestError."""
    if not len(request.push_residual):
        return None
    residual = np.array(request.push_residual, dtype=np.float64)
    if len(residual) % 3 or len(residual) > 3 * MOST_EARLIER or not np.isfinite(residual).all():
        accepted = (
            f"three finite numbers (dx, dy in m, dtheta in rad) for each of at most {MOST_EARLIER} windows, or none"
        )
        raise RequestError("push_residual", residual.tolist(), accepted)
    return residual.reshape(-1, 3)


def query_from_batch_request(request: Any) -> PushQuery:
    """The query of a PredictPushBatch request. Raises RequestError if the arrays differ in length."""
    count = len(request.velocity)
    for name in ("contact", "angle"):
        if (length := len(getattr(request, name))) != count:
            raise RequestError(f"{name} length", length, f"{count} values, as many as velocity has")
    inputs = np.array([request.velocity, request.contact, request.angle], dtype=np.float64).T
    return PushQuery(request.model, inputs, request.duration, covariates_of_pushes(request, count))


def fill_response(response: PredictPush.Response, prediction: Prediction) -> None:
    """Write the first of the predictions into a response."""
    response.mean = prediction.mean[0]
    response.covariance = prediction.covariance[0].reshape(9)
    response.process_covariance = prediction.process_covariance[0].reshape(9)
    response.in_domain = bool(prediction.in_domain[0])
    response.success = True


def extend_batch_response(response: PredictPushBatch.Response, prediction: Prediction) -> None:
    """Append n predictions to a response, push by push, each matrix row-major; `success` is left to the caller."""
    response.mean.frombytes(prediction.mean.tobytes())
    response.covariance.frombytes(prediction.covariance.tobytes())
    response.process_covariance.frombytes(prediction.process_covariance.tobytes())
    response.in_domain.extend(prediction.in_domain.tolist())


def limits_from_request(request: Any) -> Limits:
    """The robot's limits in a SuggestPushes request. Raises RequestError for one that is not accepted."""
    speed, angle = (next(iter(_intervals(name, getattr(request, name), 2)), None) for name in ("speed", "angle"))
    excluded = _intervals("excluded", request.excluded, None)
    return Limits(speed, angle, request.travel, excluded, request.transfer_speed or None)


def fill_suggest_response(response: Any, suggested: Suggested) -> None:
    """Write the suggested pushes into a response."""
    columns = (*suggested.inputs.T, suggested.duration, suggested.variance_left)
    for name, column in zip(("velocity", "contact", "angle", "duration", "variance_left"), columns, strict=True):
        setattr(response, name, doubles(column))
    response.success = True


def refuse(response: Any, reason: str, code: ErrorCode) -> Any:
    """A new response of the same kind without numbers: success false, the reason and its code, as far as it has them.

    Types of rosbag2 have no message, and some no `success`.
    """
    fields = {"success": False, "message": reason, "error_code": int(code)}
    return type(response)(**{name: value for name, value in fields.items() if hasattr(response, name)})


def prediction_from_response(response: Any) -> Prediction:
    """The predictions of either response; n = 1 for PredictPush. Raises RefusedError with the server's reason.

    The arrays are the response's own memory.
    """
    if not response.success:
        raise RefusedError(response.message)
    in_domain = response.in_domain
    return Prediction(
        np.asarray(response.mean, dtype=np.float64).reshape(-1, 3),
        np.asarray(response.covariance, dtype=np.float64).reshape(-1, 3, 3),
        np.asarray(response.process_covariance, dtype=np.float64).reshape(-1, 3, 3),
        np.array([in_domain] if isinstance(in_domain, bool) else in_domain, dtype=np.bool_),
    )


def covariates_of_push(request: Any) -> dict[str, float]:
    """The covariates of a request for one push. Raises CovariateError if values and names do not match."""
    return {name: float(value) for name, (value,) in covariates_of_pushes(request, 1).items()}


def covariates_of_pushes(request: Any, count: int) -> dict[str, Array]:
    """The covariates (count,) of each push by name. Raises CovariateError if values and names do not match."""
    names: Sequence[str] = request.covariate_names
    values = np.array(request.covariate_values, dtype=np.float64)
    if len(values) != count * len(names):
        raise CovariateError("covariate_values length", len(values), f"{count * len(names)}, one per name and push")
    if repeated := {name for name in names if names.count(name) > 1}:
        raise CovariateError("covariate_names", sorted(repeated), "each name once")
    return dict(zip(names, values.reshape(count, len(names)).T, strict=True))


def doubles(values: Array) -> array[float]:
    """The values, row-major, as messages store them: a list would be converted one by one."""
    return array("d", np.asarray(values, dtype=np.float64).tobytes())


def _push_by_push(covariates: Mapping[str, Array]) -> Array:
    return np.column_stack(list(covariates.values())) if covariates else np.empty((0, 0))


def _intervals(name: str, values: Sequence[float], most: int | None) -> tuple[Interval, ...]:
    """Pairs of successive values; most: length, None for any. Raises RequestError for another number of values."""
    if len(values) % 2 or (most is not None and len(values) > most):
        accepted = "an even number of values" if most is None else f"{most} values, or none"
        raise RequestError(f"{name} length", len(values), accepted)
    return tuple(zip(values[::2], values[1::2], strict=True))
