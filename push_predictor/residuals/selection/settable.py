# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the operator of a rig can set for further pushes, and what only continues.

Pose of the slider, dwell time and recorded topics can be set. Time, push count and distance slid only grow: time in a
rest, and distance faster than the count in long pushes. Everything else, such as the gap at the contact, is not set.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from push_predictor.geometry.frames import wrap_angle
from push_predictor.models.effects.covariate_range import CUMULATIVE, HEADINGS
from push_predictor.recordings.table import INPUTS, PushTable
from push_predictor.residuals.evidence.drivers import COUNT, DISTANCE, ENDS, TIME
from push_predictor.residuals.evidence.standardised import push_order
from push_predictor.types import Array

PLACED = ("slider_x", "slider_y", "dwell_time")
TOPIC = "topic:"
TURNS = 4  # headings of the slider that are tried
REST = 0.5  # of the session so far: a longer rest would extrapolate further
LONG_PUSH = 0.08  # m, about the length of a slider: few contacts last longer


def is_set(name: str) -> bool:
    """Whether an operator can choose the value of a covariate freely; the inputs are part of the push itself."""
    return name in PLACED or name in HEADINGS or name.startswith(TOPIC)


def is_proposed(name: str) -> bool:
    """Whether a proposed push states a value of this covariate."""
    return is_set(name) or name in CUMULATIVE


def settings(session: PushTable, rows: PushTable, drivers: Sequence[str]) -> list[dict[str, Array]]:
    """Covariates (n,) of these n rows of a session in each combination of what can be set.

    Drivers that can be set are at the low or the high end of the session's values, the slider at TURNS headings.
    """
    free = [name for name in drivers if is_set(name) and name not in HEADINGS]
    choices: list[list[dict[str, Array]]] = [_ends(session, name, len(rows)) for name in free]
    if any(name in HEADINGS for name in drivers):
        choices.append(_turned(rows))
    return [{**rows.covariates, **{k: v for part in chosen for k, v in part.items()}} for chosen in product(*choices)]


def continued(session: PushTable, drivers: Sequence[str], count: int) -> dict[str, Array]:
    """Values (count,) of the covariates that only grow, at further pushes made after a session.

    With time and another of them among the drivers, a rest comes first: time passes, the others do not.
    """
    one = np.ones(count)
    steps = {TIME: _per_push(session, TIME) * one, COUNT: one, DISTANCE: travels_of(session, drivers, count)}
    if _rested(drivers):
        steps[TIME][0] += REST * float(np.ptp(session.covariates[TIME]))
    return {
        name: float(session.covariates[name].max()) + np.cumsum(step)
        for name, step in steps.items()
        if name in session.covariates
    }


def travels_of(session: PushTable, drivers: Sequence[str], count: int) -> Array:
    """Distances (count,) in m that further pushes slide: long ones separate distance from count.

    After a rest the first half is as usual. In long pushes time, count and distance would grow together.
    """
    usual = _per_push(session, DISTANCE)
    travels = np.full(count, usual)
    if has_long_pushes(drivers):
        travels[count // 2 if _rested(drivers) else 0 :] = max(LONG_PUSH, usual)
    return travels


def has_long_pushes(drivers: Sequence[str]) -> bool:
    """Whether some of the further pushes are long."""
    return {COUNT, DISTANCE} <= set(drivers)


def _rested(drivers: Sequence[str]) -> bool:
    return TIME in drivers and bool({COUNT, DISTANCE} & set(drivers))


def proposed(covariates: Mapping[str, Array], drivers: Sequence[str], row: int) -> dict[str, float]:
    """What to set for one push: the drivers that can be, and the slider's heading if it is known."""
    names = dict.fromkeys(name for name in drivers if name not in INPUTS and is_proposed(name))
    if "slider_heading" in covariates:
        names["slider_heading"] = None
    return {name: float(covariates[name][row]) for name in names}


def _ends(session: PushTable, name: str, count: int) -> list[dict[str, Array]]:
    return [{name: np.full(count, value)} for value in np.quantile(session.covariates[name], ENDS)]


def _turned(rows: PushTable) -> list[dict[str, Array]]:
    """The slider at several headings; the direction of the push in the world turns with it."""
    own = [name for name in HEADINGS if name in rows.covariates]
    turns = 2.0 * np.pi * np.arange(TURNS) / TURNS - rows.covariates[own[0]][:, None]
    return [{name: wrap_angle(rows.covariates[name] + by) for name in own} for by in turns.T]


def _per_push(session: PushTable, name: str) -> float:
    """Mean increase of a covariate from push to push; 0 if it is not recorded."""
    if name not in session.covariates:
        return 0.0
    count = session.covariates.get(COUNT, push_order(session))
    return float(np.ptp(session.covariates[name])) / max(float(np.ptp(count)), 1.0)
