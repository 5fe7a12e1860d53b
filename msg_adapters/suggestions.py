# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""SuggestPushes <-> the robot's limits and the pushes that a model learns most from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from msg_adapters.predictions import doubles
from push_predictor.design.batch import Suggested
from push_predictor.design.limits import Interval, Limits
from push_predictor.errors import RequestError


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


def _intervals(name: str, values: Sequence[float], most: int | None) -> tuple[Interval, ...]:
    """Pairs of successive values; most: length, None for any. Raises RequestError for another number of values."""
    if len(values) % 2 or (most is not None and len(values) > most):
        accepted = "an even number of values" if most is None else f"{most} values, or none"
        raise RequestError(f"{name} length", len(values), accepted)
    return tuple(zip(values[::2], values[1::2], strict=True))
