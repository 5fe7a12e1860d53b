# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Training of models that are mechanics: fitted by the ladder, or a prior that pushes update."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from push_predictor.models.mechanics.draws import normal_draws, prior_draws
from push_predictor.models.mechanics.fit import FitRows, fit_jointly
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.ladder import Rung, climb
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.prior import ProcessNoise, drawn_parameters, prior_spreads, updated
from push_predictor.models.predictors import MechanicsPredictor, PriorPredictor
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array
from push_predictor.watch import Watch, no_watch


@dataclass(frozen=True, eq=False)
class TrainedMechanics:
    """A predictor of fitted mechanics, and the ladder that chose its parameters."""

    predictor: MechanicsPredictor
    ladder: list[Rung]


def train_mechanics(
    mechanics: PushMechanics, rows: PushTable, search: PushTable, watch: Watch = no_watch
) -> TrainedMechanics:
    """Choose the free parameters on the rows `search`, fit them to all rows, and take the covariance of those.

    Raises TrainingError for fewer than two rows.
    """
    ladder = climb(mechanics, fit_rows(search), watch)
    last = ladder[-1].fit
    if len(search) < len(rows):
        watch("fit mechanics: all rows", 0.9)
        last = fit_jointly(mechanics, fit_rows(rows), last.names, last.values)
    return TrainedMechanics(predictor_about(FittedMechanics(mechanics, last.values, last.covariance), rows), ladder)


def predictor_about(fitted: FittedMechanics, rows: PushTable) -> MechanicsPredictor:
    """The predictor with the covariance of its residuals on these rows."""
    residuals = rows.outcomes - fitted.displacement(rows.inputs, rows.duration, rows.covariates)
    return MechanicsPredictor(fitted, residuals.T @ residuals / len(residuals))


def fit_rows(table: PushTable) -> FitRows:
    """The rows of a table as the fit takes them."""
    push = np.unique(table.push_id, return_inverse=True)[1]
    return FitRows(table.inputs, table.duration, table.outcomes, push, table.covariates)


def prior_predictor(mechanics: PushMechanics, rig: Rig, seed: int = 0) -> PriorPredictor:
    """The predictor before the first push.

    The prior of the contact friction is about the rig's coefficient, where it has one. seed: of the draws.
    """
    names = drawn_parameters(known_support=mechanics.support is not None)
    known = {} if rig.contact_friction is None else {"contact_friction": rig.contact_friction}
    means = {name: known.get(name, BY_NAME[name].textbook) for name in names}
    within = {name: float(np.clip(mean, BY_NAME[name].low, BY_NAME[name].high)) for name, mean in means.items()}
    fitted = FittedMechanics(mechanics, within, np.diag(prior_spreads(names) ** 2))
    return PriorPredictor(fitted, prior_draws(fitted, seed), ProcessNoise())


def sharpened(before: PriorPredictor, rows: PushTable, seed: int = 0) -> PriorPredictor:
    """The predictor `before` the first push, updated by the pushes of a table with any number of rows."""
    if not len(rows):
        return before
    mechanics, names = before.fitted.mechanics, tuple(before.fitted.values)
    push = np.unique(rows.push_id, return_inverse=True)[1]
    fit_rows = FitRows(rows.inputs, rows.duration, rows.outcomes, push, rows.covariates)
    found = updated(mechanics, names, _values(before.fitted.values), fit_rows, before.fitted.ellipsoid.length)
    values = dict(zip(names, found.values.tolist(), strict=True))
    fitted = FittedMechanics(mechanics, values, found.covariance)
    return PriorPredictor(fitted, normal_draws(fitted, seed), found.noise)


def _values(values: Mapping[str, float]) -> Array:
    return np.array(list(values.values()))
