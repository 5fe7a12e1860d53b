# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a validator publishes: a window and its prediction -> PushResidual, an alarm that has fired -> PushAlarm."""

from __future__ import annotations

import numpy as np

from msg_adapters import ns_to_stamp
from push_predictor.errors import RequestError
from push_predictor.evaluation.alarm.evidence import AlarmState
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
    return message


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
