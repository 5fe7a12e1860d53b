# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A model extended by effects: the effects shift its mean, and its base is retrained on the outcomes minus them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.traced_session import TracedSession
from push_predictor.models.predictors import Cross, ExtendedPredictor, Predictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.train import retrain_model
from push_predictor.residuals.candidates.candidate import Candidate
from push_predictor.residuals.candidates.joint_fit import FitRows, estimated, fitted
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.extension.recalibration import held_out_windows
from push_predictor.residuals.extension.refit import spread_rows, with_predictor


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
        shift, _ = predictor.shift(Push(table.inputs, table.duration, table.covariates))
        trained = retrain_model(base.base, replace(table, outcomes=table.outcomes - shift))
        of_trained = predictor.with_base(trained.predictor.base)
        return held_out_windows(with_predictor(trained, table, of_trained)).calibrated()
    return held_out_windows(with_predictor(base, table, predictor)).calibrated()


def _with_effects(predictor: Predictor, effects: tuple[Effect, ...], cross: Cross) -> ExtendedPredictor:
    """The predictor with these effects after those that it has, unscaled."""
    had = len(predictor.effects)
    moved = {(had + i, had + j): shared for (i, j), shared in cross.items()}
    return ExtendedPredictor(predictor.base, (*predictor.effects, *effects), np.ones(3), {**predictor.cross, **moved})
