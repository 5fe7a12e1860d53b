# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""SuggestPushes <-> the robot's limits and the pushes that a model learns most from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from msg_adapters.predictions import covariates_of_push, doubles
from push_predictor.design.batch import Suggested
from push_predictor.design.limits import Interval, Limits
from push_predictor.errors import RequestError


@dataclass(frozen=True)
class SuggestQuery:
    """A request. model: a name, empty for the default one. covariates: by name, of all pushes. seed: of candidates."""

    model: str
    count: int
    limits: Limits
    covariates: dict[str, float]
    seed: int


def query_from_suggest_request(request: Any) -> SuggestQuery:
    """The query of a SuggestPushes request. Raises RequestError for a limit or covariates that are not accepted."""
    speed, angle = (_intervals(name, getattr(request, name), 2) for name in ("speed", "angle"))
    excluded = _intervals("excluded", request.excluded, None)
    limits = Limits(
        speed[0] if speed else None,
        angle[0] if angle else None,
        request.travel,
        excluded,
        request.transfer_speed if request.transfer_speed != 0.0 else None,
    )
    return SuggestQuery(request.model, request.count, limits, covariates_of_push(request), request.seed)


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
