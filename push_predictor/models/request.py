"""Is this a push that a model may answer for? One place, for the services, the command line and the library."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, isfinite, pi
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.pushes import Pushes
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from push_predictor.models.push_model import PushModel

UNITS = {
    "elapsed_time": "s",
    "slid_distance": "m",
    "slider_x": "m",
    "slider_y": "m",
    "slider_heading": "rad",
    "push_heading": "rad",
    "velocity": "m/s",
    "angle": "rad",
    "dwell_time": "s",
    "time_since_contact": "s",
    "contact_gap": "m",
    "normal_force": "N",
    "tangential_force": "N",
}  # of the covariates that windows have; a recorded topic's is its sender's
FARTHEST = 1.0  # m a push; mechanics is integrated along the way, some milliseconds for a centimetre


def check_request(
    model: PushModel, velocity: float, contact: float, angle: float, duration: float, covariates: Mapping[str, float]
) -> None:
    """Raise RequestError naming field, value and what is accepted, unless the model can answer this push."""
    low, high = model.duration_range
    if (
        0.0 < velocity < inf
        and 0.0 <= contact < 1.0
        and abs(angle) < pi / 2.0
        and 0.0 < duration < inf
        and low <= duration <= high
        and velocity * duration <= _farthest(model)
        and all(map(isfinite, covariates.values()))
        and all(name in covariates for name in model.needs)
    ):
        return  # in a microsecond; the rest is for saying what is wrong
    _check(model, np.array([[velocity, contact, angle]]), duration, {k: np.array([v]) for k, v in covariates.items()})


def check_requests(model: PushModel, inputs: Array, duration: float, covariates: Mapping[str, Array]) -> None:
    """The same for n pushes (n, 3) of one duration; the field in the error carries the index of the first bad push."""
    _check(model, inputs, duration, covariates, places=np.arange(len(inputs)))


def _check(
    model: PushModel, inputs: Array, duration: float, covariates: Mapping[str, Array], places: IntArray | None = None
) -> None:
    """Places (n,): index of each push in the caller's list, for the error; None for a single push."""
    velocity, contact, angle = inputs.T
    rules: list[tuple[str, Array, BoolArray, str]] = [
        ("velocity", velocity, velocity > 0.0, "a finite number above 0, in m/s"),
        ("contact", contact, (contact >= 0.0) & (contact < 1.0), "a fraction of the perimeter in [0, 1)"),
        ("angle", angle, np.abs(angle) < np.pi / 2.0, "an angle in (-pi/2, pi/2), in rad"),
        *((f"covariate {name}", column, np.isfinite(column), _meaning(name)) for name, column in covariates.items()),
    ]
    for field, column, accepted, meaning in rules:
        bad = np.flatnonzero(~(accepted & np.isfinite(column)))
        if bad.size:
            place = field if places is None else f"{field}[{places[bad[0]]}]"
            raise RequestError(place, float(column[bad[0]]), meaning)
    for name in model.needs:
        if name not in covariates:
            raise RequestError(f"covariate {name}", "missing", f"{_meaning(name)}: {model.name} needs it")
    _check_duration(model, duration)
    if (too_fast := np.flatnonzero(velocity * duration > _farthest(model))).size:
        place = "velocity" if places is None else f"velocity[{places[too_fast[0]]}]"
        most = f"at most {FARTHEST / duration:.3g} m/s for {duration:g} s: a way of {FARTHEST:g} m"
        raise RequestError(place, float(velocity[too_fast[0]]), most)


def _farthest(model: PushModel) -> float:
    """How long (m) a push may be that a model answers for."""
    return inf if isinstance(model.predictor, GaussianProcessPredictor) else FARTHEST


def _meaning(covariate: str) -> str:
    return f"a finite number, in {UNITS[covariate]}" if covariate in UNITS else "a finite number"


def _check_duration(model: PushModel, duration: float) -> None:
    low, high = model.duration_range
    if not (np.isfinite(duration) and duration > 0.0):
        raise RequestError("duration", duration, "a finite number above 0, in s")
    if not low <= duration <= high:
        raise RequestError("duration", duration, f"{low:.3g} to {high:.3g} s, near what {model.name} was trained on")


def check_pushes(model: PushModel, pushes: Pushes) -> None:
    """The same for pushes that may differ in duration; covariates that the model does not need are ignored."""
    needed = {name: column for name, column in pushes.covariates.items() if name in model.needs}
    for duration in np.unique(pushes.duration):
        rows = np.flatnonzero(pushes.duration == duration)
        columns = {name: column[rows] for name, column in needed.items()}
        _check(model, pushes.inputs[rows], float(duration), columns, places=rows if len(pushes) > 1 else None)


def check_table(model: PushModel, table: PushTable) -> None:
    """The same for the rows of a table, each with its own duration, and the covariates that the model needs of it.

    Raises RequestError.
    """
    for duration in np.unique(table.duration):
        rows = table.take(table.duration == duration)
        needed = {name: column for name, column in rows.covariates.items() if name in model.needs}
        check_requests(model, rows.inputs, float(duration), needed)
