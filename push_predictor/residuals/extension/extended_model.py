# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The refit, which is the same model trained on the new pushes, and the model extended by effects.

Effects shift the mean, and the base is retrained on the outcomes minus them. The refit is the fair reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from push_predictor import __version__
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.traced_session import TracedSession
from push_predictor.models.predictors import Cross, ExtendedPredictor, Predictor
from push_predictor.models.push_model import Provenance, PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.train import retrain_model, training_rows
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.candidates.joint_fit import FitRows, estimated, fitted
from push_predictor.residuals.evidence.drivers import COUNT, DISTANCE, TIME
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.extension.held_out_gain import held_out_windows
from push_predictor.residuals.selection.search import Term

FEWEST_ROWS, MOST_ROWS = 300, 500  # guard against a refit from too few rows, and against hours of it


def extend(
    base: PushModel, evidence: Evidence, candidates: Sequence[Candidate], session: TracedSession = TracedSession()
) -> PushModel:
    """The base with these candidates as effects, retrained without them if learnt, and its deviations scaled to fit.

    evidence: of the deployed model, which was not trained on these pushes. A base that was trained on them has absorbed
    part of the effects, so its own residuals would make them too small. session: the one that these pushes end.
    Raises TrainingError for too few rows.
    """
    learnt, absorbs = base.predictor.learnt, base.predictor.absorbs
    # About mechanics, a learnt base expresses little in its own inputs, and a refit keeps the mechanics.
    own_inputs = inputs_basis(base, evidence.table).columns if learnt and absorbs else np.empty((0, 0))
    effects, cross = estimated(fitted(FitRows(evidence, controls=own_inputs), candidates), of_size=True)
    predictor = replace(_with_effects(base.predictor, effects, cross), session=session)
    table = spread_rows(base, evidence.table)
    if learnt or absorbs:
        shift, _ = predictor.shift(Push.of(table))
        trained = retrain_model(base.base, replace(table, outcomes=table.outcomes - shift), nearby=True)
        of_trained = predictor.with_base(trained.predictor.base)
        return held_out_windows(with_predictor(trained, table, of_trained)).calibrated()
    return held_out_windows(with_predictor(base, table, predictor)).calibrated()


def _with_effects(predictor: Predictor, effects: tuple[Effect, ...], cross: Cross) -> ExtendedPredictor:
    """The predictor with these effects after those that it has, unscaled."""
    had = len(predictor.effects)
    moved = {(had + i, had + j): shared for (i, j), shared in cross.items()}
    return ExtendedPredictor(predictor.base, (*predictor.effects, *effects), np.ones(3), {**predictor.cross, **moved})


def by_the_clock(term: Term, table: PushTable) -> Candidate:
    """The candidate of a term; a step of count or distance that time explains as well is the same step of time.

    An effect that grows keeps its covariate: a pause, in which time goes on alone, must not let it grow.
    """
    best = term.best
    if best.basis.name != "step" or best.covariate not in (COUNT, DISTANCE) or TIME not in term.naming.covariates:
        return best
    elapsed, after = table.covariates[TIME], best.basis.values(table.covariates, len(table))[:, 0] > 0.0
    before, since = float(elapsed[~after].max()), float(elapsed[after].min())
    if before >= since:
        return best
    step = DriverBasis("step", (TIME,), place=0.5 * (before + since))
    return replace(best, covariate=TIME, basis=step)  # with the same values


def along(named: Candidate, effect: Effect) -> Effect:
    """The effect along the covariate of the candidate that it was named after, which has the same values."""
    return replace(effect, covariate=named.covariate, basis=named.basis)


def refit_base(model: PushModel, table: PushTable) -> PushModel:
    """Refit a model to these pushes in its own inputs alone; effects that it already has stay as they are.

    See `retrain_model` for what is estimated again. Raises TrainingError for too few rows.
    """
    predictor, table = model.predictor, spread_rows(model, table)
    if not predictor.effects:
        return retrain_model(model, table)
    shift, _ = predictor.shift(Push.of(table))
    base = retrain_model(model.base, replace(table, outcomes=table.outcomes - shift))
    return with_predictor(base, table, predictor.with_base(base.predictor.base))


def spread_rows(model: PushModel, table: PushTable) -> PushTable:
    """The rows that a learnt model is retrained on: as many as it has, within bounds, spread over the pushes."""
    if not model.predictor.learnt:
        return table
    most = int(np.clip(len(model.training), FEWEST_ROWS, MOST_ROWS))
    return table.take(training_rows(table, None, model.provenance.seed, most))


def with_predictor(base: PushModel, table: PushTable, predictor: Predictor) -> PushModel:
    """The model of a predictor; its training rows are those that the base was trained on, as observed."""
    seed, sources = base.provenance.seed, base.provenance.sources
    provenance = Provenance(sources, len(table.pushes), seed, __version__)
    return replace(base, predictor=predictor, training=table, provenance=provenance)
