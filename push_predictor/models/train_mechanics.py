# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models that are mechanics: fitted by the ladder, a prior that pushes update, or moved to other supports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from push_predictor.models.mechanics.fit import FitRows, fit_jointly
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics, mechanics_on
from push_predictor.models.mechanics.ladder import Rung, climb
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.prior import (
    ProcessNoise,
    drawn_parameters,
    normal_draws,
    prior_draws,
    prior_spreads,
    updated,
)
from push_predictor.models.predictors import GaussianProcessPredictor, MechanicsPredictor, PriorPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array
from push_predictor.watch import Watch, no_watch


def train_mechanics(
    mechanics: PushMechanics, rows: PushTable, search: PushTable, watch: Watch = no_watch
) -> tuple[MechanicsPredictor, list[Rung]]:
    """Choose the free parameters on the rows `search`, fit them to all rows, and take the covariance of those.

    Returns the ladder of parameters too. Raises TrainingError for fewer than two rows.
    """
    ladder = climb(mechanics, fit_rows(search), watch)
    last = ladder[-1].fit
    if len(search) < len(rows):
        watch("fit mechanics: all rows", 0.9)
        last = fit_jointly(mechanics, fit_rows(rows), last.names, last.values)
    return predictor_about(FittedMechanics(mechanics, last.values, last.covariance), rows), ladder


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
    fitted, noise = updated(before.fitted, fit_rows(rows))
    return PriorPredictor(fitted, normal_draws(fitted, seed), noise)


def on_supports(model: PushModel, rig: Rig | None, supports: Mapping[int, Array]) -> PushModel:
    """The model for recordings on these supports; itself unless it knows the supports of several recordings.

    supports: support points (k, 3) as in Rig, by number of the recording; empty if all stand on those of the rig.
    """
    base = model.predictor.base
    if not isinstance(base, MechanicsPredictor | GaussianProcessPredictor):
        return model
    known = base.fitted if isinstance(base, MechanicsPredictor) else base.mean
    if known is None or not known.mechanics.supports or (rig is None and not supports):
        return model
    points = None if rig is None else rig.support_points
    moved = replace(known, mechanics=mechanics_on(known.outline, known.mechanics.pusher_radius, points, supports))
    again = replace(base, fitted=moved) if isinstance(base, MechanicsPredictor) else replace(base, mean=moved)
    return replace(model, predictor=model.predictor.with_base(again))
