# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a validator publishes: a window and its prediction <-> PushResidual, an alarm that has fired -> PushAlarm."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from msg_adapters import ns_to_stamp
from push_predictor.errors import RequestError
from push_predictor.evaluation.alarm.evidence import AlarmState
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.types import Array
from push_predictor_interfaces.msg import PushAlarm, PushResidual


def residual_to_message(
    model: str, window: PushWindow, mean: Array, covariance: Array, in_domain: bool, frame_id: str
) -> PushResidual:
    """The message of a window and a model's prediction (3,), (3, 3) of it, made in or out of the model's domain.

    frame_id: of the poses. standardised: L^-1 (observed - predicted), with L L' = covariance. Raises RequestError if
    there is no such L.
    """
    try:
        factor = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        raise RequestError("covariance", covariance.tolist(), "a positive definite matrix") from None
    message = PushResidual(push_id=window.push_id, window=int(window.index), model=model, in_domain=bool(in_domain))
    message.header.stamp, message.header.frame_id = ns_to_stamp(window.end), frame_id
    message.velocity, message.contact, message.angle = map(float, (window.velocity, window.contact, window.angle))
    message.duration = float(window.duration)
    message.predicted, message.observed = _flat(mean), _flat(window.displacement)
    message.covariance = _flat(covariance)
    message.standardised = _flat(np.linalg.solve(factor, window.displacement - mean))
    message.covariate_names = list(window.covariates)
    message.covariate_values = [float(value) for value in window.covariates.values()]
    return message


def residuals_to_table(messages: Sequence[PushResidual]) -> PushTable:
    """The windows as rows of a table, without predictions; a covariate is kept if every window has it.

    Raises RequestError for lists of covariates of different lengths, and for a number that is not finite.
    """
    given = []
    for message in messages:
        if len(message.covariate_names) != len(message.covariate_values):
            accepted = f"{len(message.covariate_names)} values, as many as names"
            raise RequestError("covariate_values length", len(message.covariate_values), accepted)
        given.append(dict(zip(message.covariate_names, message.covariate_values, strict=True)))
    common = [name for name in given[0] if all(name in each for each in given)]
    table = PushTable(
        np.array([[m.velocity, m.contact, m.angle] for m in messages]),
        np.array([m.duration for m in messages]),
        np.array([m.observed for m in messages]),
        np.array([m.push_id for m in messages], dtype=np.str_),
        {name: np.array([each[name] for each in given]) for name in common},
    )
    for name, values in (("observed", table.outcomes), ("velocity, contact, angle", table.inputs)):
        if not np.all(np.isfinite(values)):
            raise RequestError(name, values[~np.all(np.isfinite(values), axis=1)][0].tolist(), "finite numbers")
    return table


def _flat(values: Array) -> Array:
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)


def alarm_to_message(state: AlarmState, model: str, stamp_ns: int, frame_id: str) -> PushAlarm:
    """The message of an alarm about a model. stamp_ns: end of the push at which it fired.

    Raises RequestError if it has not fired.
    """
    if state.fired_at is None or state.fired_after is None or state.fired_evidence is None or state.fired_by is None:
        raise RequestError("alarm", state, "an alarm that has fired")
    message = PushAlarm(push_id=state.fired_at, pushes=state.fired_after, model=model, score=state.fired_by)
    message.header.stamp, message.header.frame_id = ns_to_stamp(stamp_ns), frame_id
    message.log10_evidence, message.false_alarm_rate = state.fired_evidence, state.false_alarm_rate
    return message
