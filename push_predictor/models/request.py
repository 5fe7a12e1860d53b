# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rules of a request: which pushes a model predicts, and what to remark on those far from its training data.

Services, command line and library share them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf, pi
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from push_predictor.errors import CovariateError, RequestError
from push_predictor.models.effects.covariates import UNITS
from push_predictor.models.pushes import Push, Pushes
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, BoolArray

if TYPE_CHECKING:
    from push_predictor.models.push_model import PushModel

Numbers: TypeAlias = "float | Array"  # one push, or a column (n,)

OUT_OF_DOMAIN = "out of domain"
FARTHEST = 1.0  # m per push; the mechanics are integrated along the path


@dataclass(frozen=True)
class PushRequest:
    """One push: velocity (m/s), contact (fraction of the perimeter), angle (rad), duration (s), covariates by name."""

    velocity: float
    contact: float
    angle: float
    duration: float
    covariates: Mapping[str, float] = field(default_factory=dict)

    @property
    def arrays(self) -> tuple[Array, Array, dict[str, Array]]:
        """The arguments of PushModel.predict_rows: inputs (1, 3), duration (1,), covariates (1,) by name."""
        columns = {name: np.array([value]) for name, value in self.covariates.items()}
        return np.array([[self.velocity, self.contact, self.angle]]), np.array([self.duration]), columns


def with_own_window(model: PushModel, push: PushRequest) -> PushRequest:
    """The push with the duration that it means; see own_window."""
    return push if push.duration else replace(push, duration=model.usual_duration)


def own_window(model: PushModel, duration: float) -> float:
    """The duration (s) that a request means: 0 stands for the model's own window."""
    return model.usual_duration if duration == 0.0 else duration


def check_request(model: PushModel, push: PushRequest) -> None:
    """Raise RequestError unless the model predicts this push; it names field, value and what is accepted."""
    _check(model, push.velocity, push.contact, push.angle, push.duration, push.covariates)


def check_requests(model: PushModel, inputs: Array, duration: float | Array, covariates: Mapping[str, Array]) -> None:
    """Raise RequestError unless the model predicts n pushes: inputs (n, 3), duration one for all or (n,) s.

    The field in the error carries the index of the first push that breaks the rule.
    """
    velocity, contact, angle = inputs.T
    _check(model, velocity, contact, angle, duration, covariates)


def check_pushes(model: PushModel, pushes: Pushes | PushTable) -> None:
    """Raise RequestError unless the model predicts these pushes; covariates that it does not use are ignored."""
    needed = {name: column for name, column in pushes.covariates.items() if name in model.accepted}
    if len(pushes) != 1:
        check_requests(model, pushes.inputs, pushes.duration, needed)
    else:
        velocity, contact, angle = pushes.inputs[0].tolist()
        covariates = {name: float(column[0]) for name, column in needed.items()}
        _check(model, velocity, contact, angle, float(pushes.duration[0]), covariates)


def _check(
    model: PushModel,
    velocity: Numbers,
    contact: Numbers,
    angle: Numbers,
    duration: Numbers,
    covariates: Mapping[str, Numbers],
) -> None:
    """Raise RequestError for the first rule that is broken. Comparisons with NaN are false, so NaN breaks each rule."""
    _require("velocity", velocity, (velocity > 0.0) & (velocity < inf), "a finite number above 0, in m/s")
    _require("contact", contact, (contact >= 0.0) & (contact < 1.0), "a fraction of the perimeter in [0, 1)")
    _require("angle", angle, (angle > -pi / 2.0) & (angle < pi / 2.0), "an angle in (-pi/2, pi/2), in rad")
    for name, values in covariates.items():
        if (finite := (values > -inf) & (values < inf)) is not True:
            _require(f"covariate {name}", values, finite, _finite_number(name), error=CovariateError)
    for name in model.needs:
        if name not in covariates:
            raise CovariateError(f"covariate {name}", "missing", f"{_finite_number(name)}: {model.name} needs it")
    _require("duration", duration, (duration > 0.0) & (duration < inf), "a finite number above 0, in s")
    low, high = model.duration_range
    near = "{:.3g} to {:.3g} s, close to the training durations of {}"
    _require("duration", duration, (duration >= low) & (duration <= high), near, low, high, model.name)
    most = "at most {:.3g} m/s for {:g} s: a path of {:g} m"
    _require("velocity", velocity, velocity * duration <= FARTHEST, most, FARTHEST / duration, duration, FARTHEST)


def _require(
    name: str,
    values: Numbers,
    accepted: bool | BoolArray,
    meaning: str,
    *details: object,
    error: type[RequestError] = RequestError,
) -> None:
    """Raise `error` for the first value that is not accepted; for a column the name gets its index.

    meaning: a format string that states what is accepted. details: its numbers, each one for all pushes or a column.
    The string is filled only for an error.
    """
    if not isinstance(accepted, np.ndarray):
        if not accepted:
            raise error(name, float(values), meaning.format(*details))
    elif not accepted.all():
        index = int(np.argmin(accepted))
        filled = meaning.format(*(_at(detail, index) for detail in details))
        raise error(f"{name}[{index}]", _at(values, index), filled)


def _at(values: object, index: int) -> object:
    """The value for one push: the entry of a column, or a value for all pushes."""
    return float(values[index]) if isinstance(values, np.ndarray) else values


def _finite_number(covariate: str) -> str:
    return f"a finite number, in {UNITS[covariate]}" if covariate in UNITS else "a finite number"


def domain_remark(model: PushModel, push: Push, in_domain: BoolArray) -> str:
    """What a client should know of n predicted pushes, of which in_domain (n,) are in the domain; empty if all are.

    The text begins with OUT_OF_DOMAIN, and names what is outside for the first push that is.
    """
    if in_domain.all():
        return ""
    count, first, outside = len(in_domain), int(in_domain.argmin()), int(np.count_nonzero(~in_domain))
    which = "" if count == 1 else f"{outside} of {count} pushes, first push {first}: "
    return f"{OUT_OF_DOMAIN}: {which}{_reason(model, push, first)}"


def _reason(model: PushModel, push: Push, row: int) -> str:
    """What of a push is outside."""
    velocity, contact, angle = push.inputs[row].tolist()
    limits, outside = model.input_limits, []
    for name, value, (low, high) in (("velocity", velocity, limits.velocity), ("angle", angle, limits.angle)):
        if not low <= value <= high:
            outside.append(_outside(name, name, value, f"{low:.4g} to {high:.4g}"))
    covariates = model.predictor.completed(push.take(slice(row, row + 1))).covariates
    for name, known in model.covariate_ranges.items():
        if not known.contains(covariates[name])[0]:
            outside.append(_outside(f"covariate {name}", name, float(covariates[name][0]), str(known)))
    return "; ".join(outside) or f"contact {contact:.4g}, beyond those of the training pushes"


def _outside(title: str, name: str, value: float, accepted: str) -> str:
    unit = f" {UNITS[name]}" if name in UNITS else ""
    return f"{title} {value:.4g}{unit}, training covers {accepted}{unit}"
