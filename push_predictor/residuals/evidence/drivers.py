# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The covariates that an effect may depend on, and the bases of the screen and of the search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from push_predictor.models.effects.covariates import COVARIATES, CUMULATIVE, HEADINGS, of_kind
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

CATEGORIES, PLACE, SENSOR_ZERO = of_kind("category"), of_kind("place"), of_kind("sensor zero")
# They vary along a push, or share noise with the residual: no causes.
LOCAL = tuple(name for name, covariate in COVARIATES.items() if covariate.local)
TIME, COUNT, DISTANCE = CUMULATIVE  # they only grow
OF_SESSION = (*CUMULATIVE, "recording")  # counted from the start of a session
FOLDED = tuple(name for name, covariate in COVARIATES.items() if covariate.folded)
NO_CAUSES = (*of_kind("force"), *SENSOR_ZERO, *LOCAL, *FOLDED)
CONSTANT = "model_inputs"
SESSION = "session"  # the step between the training pushes and the later ones
UNDRIVEN = (CONSTANT, SESSION)
MOST_LEVELS = 12  # guards against a category that has a level for every few pushes: it would explain anything
ENDS = (0.05, 0.95)  # quantiles of a covariate between which a change is reported
SETTLED = 0.03  # s of contact after which pusher and slider move together
STEPS = 9  # places of a step that are tried first, at quantiles of the covariate
SOON = 0.03  # of the covariate's range: scale of an effect that grows early in it


def screening_bases(table: PushTable, names: Sequence[str] | None = None) -> list[tuple[str, DriverBasis]]:
    """Pairs (covariate, basis) in which each covariate enters the screen; names: all that vary if None."""
    bases: list[tuple[str, DriverBasis]] = []
    for name in driver_names(table) if names is None else names:
        bases += [(name, basis) for basis in _bases_of(name, table.covariates[name])]
    if all(name in dict(bases) for name in PLACE):
        bases.append((PLACE[0], two_dimensional(table)))
    return bases


def driver_names(table: PushTable) -> list[str]:
    """Names of the covariates that vary and may be causes."""
    return [name for name, column in table.covariates.items() if name not in NO_CAUSES and _varies(column)]


def at_touch(table: PushTable) -> Array:
    """1 for windows that begin with the first touch of a push, 0 for others (n,); all 0 where it was not recorded."""
    since = table.covariates.get("time_since_contact", np.full(len(table), np.inf))
    return np.asarray(since < SETTLED, dtype=np.float64)


def two_dimensional(table: PushTable) -> DriverBasis:
    """A second-order map over the position on the table."""
    x, y = (table.covariates[name] for name in PLACE)
    return DriverBasis("map", PLACE, (float(x.mean()), float(y.mean())), (float(x.std()), float(y.std())))


def standard_basis(name: str, driver: str, values: Array) -> DriverBasis:
    """A basis of one scalar covariate, centred and scaled on its values (n,)."""
    scale = float(np.ptp(values)) / 3.0 if name == "logarithmic" else float(values.std())
    return DriverBasis(name, (driver,), (float(values.mean()),), (scale,), place=float(values.min()))


def between_ends(basis: DriverBasis, table: PushTable) -> Array | None:
    """Values (m,) of a basis at the upper end of its covariate less those at the lower; None if it has no ends."""
    if basis.name == "step":
        return np.ones(1)  # wherever it is
    if basis.name not in ("linear", "logarithmic", "quadratic"):
        return None
    values, driver = basis.values(table.covariates, len(table)), np.asarray(table.covariates[basis.drivers[0]])
    low, high = (int(np.argmin(np.abs(driver - np.quantile(driver, share)))) for share in ENDS)
    return np.asarray(values[high] - values[low])


def _bases_of(name: str, values: Array) -> list[DriverBasis]:
    if name in HEADINGS:
        return [DriverBasis("periodic", (name,)), DriverBasis("periodic, twice around", (name,))]
    if name in CATEGORIES:
        levels = tuple(float(level) for level in np.unique(values))
        return [DriverBasis("category", (name,), levels=levels)] if 1 < len(levels) <= MOST_LEVELS else []
    return [standard_basis("linear", name, values), standard_basis("quadratic", name, values)]


def _varies(values: Array) -> bool:
    return bool(np.all(np.isfinite(values)) and np.ptp(values) > 1e-9 * (1.0 + np.abs(values).max()))


def forms_of(covariate: str, table: PushTable) -> list[DriverBasis]:
    """Growing from zero at the start, a step at an onset, any line or curve; of a heading periodic; simplest first."""
    if float(np.ptp(table.covariates[covariate])) == 0.0:  # in the windows of a fit, though not in all
        return [DriverBasis("constant")]
    if covariate in CATEGORIES:
        levels = tuple(float(level) for level in np.unique(table.covariates[covariate]))
        return [DriverBasis("category", (covariate,), levels=levels, offset=True)]
    if covariate in HEADINGS:
        return [DriverBasis(name, (covariate,), offset=True) for name in ("periodic", "periodic, twice around")]
    values = table.covariates[covariate]
    linear, logarithmic, quadratic = (
        standard_basis(n, covariate, values) for n in ("linear", "logarithmic", "quadratic")
    )
    forms = [replace(linear, centre=(float(values.min()),)), logarithmic]
    if covariate in CUMULATIVE:
        forms.append(replace(logarithmic, scale=(SOON * float(np.ptp(values)),)))
    forms += [DriverBasis("step", (covariate,), place=place) for place in step_places(values)]
    forms.append(replace(linear, offset=True))
    if covariate in CUMULATIVE:
        return forms
    forms += [linear, replace(quadratic, offset=True)]
    if covariate in PLACE and all(name in table.covariates for name in PLACE):
        forms.append(replace(two_dimensional(table), offset=True))
    return forms


def step_places(values: Array) -> list[float]:
    """Places that are tried first: midpoints between the values at even quantiles and the values before them."""
    ordered = np.unique(values)
    if len(ordered) < 2:
        return []
    marks = np.quantile(values, np.arange(1, STEPS + 1) / (STEPS + 1.0))
    index = np.unique(np.clip(np.searchsorted(ordered, marks), 1, len(ordered) - 1))
    return [float(0.5 * (ordered[k - 1] + ordered[k])) for k in index]
