"""What may drive an effect: every covariate of the windows that varies, in the way it can enter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from push_predictor.models.effects.covariate_range import HEADINGS
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

CATEGORIES = ("edge", "recording")
PLACE = ("slider_x", "slider_y")
OUTCOMES = ("normal_force", "tangential_force")  # of the same window: what the push did to the sensor, not a cause
# They share noise with the residual, or go with the course of a push: judged against their relation in training.
LOCAL = ("contact_gap", "time_since_contact", "previous_residual")
STANDING = ("edge", *HEADINGS, *PLACE, "velocity")  # of the rig, on any day
FOLDED = ("contact", "angle")  # inputs that mechanisms and fall-back take already
CONSTANT = "model_inputs"
MOST_LEVELS = 12
SETTLED = 0.03  # s of contact after which tip and slider move together


def screening_forms(table: PushTable, names: Sequence[str] | None = None) -> list[tuple[str, DriverBasis]]:
    """(covariate, form) pairs by which each driver enters the screen. names: drivers to try, all that vary if None."""
    forms: list[tuple[str, DriverBasis]] = []
    for name in driver_names(table) if names is None else names:
        forms += [(name, form) for form in _forms_of(name, table.covariates[name])]
    if all(name in dict(forms) for name in PLACE):
        forms.append((PLACE[0], two_dimensional(table)))
    return forms


def driver_names(table: PushTable) -> list[str]:
    """Covariates that vary and could be causes."""
    return [name for name, column in table.covariates.items() if name not in (*OUTCOMES, *FOLDED) and _varies(column)]


def two_dimensional(table: PushTable) -> DriverBasis:
    """A map over the place on the table."""
    x, y = (table.covariates[name] for name in PLACE)
    return DriverBasis("map", PLACE, (float(x.mean()), float(y.mean())), (float(x.std()), float(y.std())))


def standard_form(name: str, driver: str, values: Array) -> DriverBasis:
    """A form of a scalar driver, centred and scaled on its values (n,)."""
    scale = float(np.ptp(values)) / 3.0 if name == "logarithmic" else float(values.std())
    return DriverBasis(name, (driver,), (float(values.mean()),), (scale,), place=float(values.min()))


def _forms_of(name: str, values: Array) -> list[DriverBasis]:
    if name in HEADINGS:
        return [DriverBasis("periodic", (name,)), DriverBasis("periodic, twice around", (name,))]
    if name in CATEGORIES:
        levels = tuple(float(level) for level in np.unique(values))
        return [DriverBasis("category", (name,), levels=levels)] if 1 < len(levels) <= MOST_LEVELS else []
    return [standard_form("linear", name, values), standard_form("quadratic", name, values)]


def _varies(values: Array) -> bool:
    return bool(np.all(np.isfinite(values)) and np.ptp(values) > 1e-9 * (1.0 + np.abs(values).max()))
