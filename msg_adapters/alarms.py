# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The state of an alarm that has fired -> push_predictor_interfaces/PushAlarm."""

from __future__ import annotations

from msg_adapters import MessageError
from msg_adapters.stamps import ns_to_stamp
from push_predictor.evaluation.alarm.evidence import AlarmState
from push_predictor_interfaces.msg import PushAlarm


def alarm_to_message(state: AlarmState, model: str, stamp_ns: int, frame_id: str = "world") -> PushAlarm:
    """The message of an alarm about a model. stamp_ns: end of the push at which it fired.

    Raises MessageError if it has not fired.
    """
    if state.fired_at is None or state.fired_after is None or state.fired_evidence is None or state.fired_by is None:
        raise MessageError("alarm", state, "an alarm that has fired")
    message = PushAlarm(push_id=state.fired_at, pushes=state.fired_after, model=model, score=state.fired_by)
    message.header.stamp, message.header.frame_id = ns_to_stamp(stamp_ns), frame_id
    message.log10_evidence, message.false_alarm_rate = state.fired_evidence, state.false_alarm_rate
    return message
