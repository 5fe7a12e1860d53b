# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a trace goes on with where new pushes leave the inputs of training: mechanics, and noise in proportion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.models.predictors import GaussianProcessPredictor, MechanicsPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.residuals.evidence.input_shift import InputShift
from push_predictor.residuals.evidence.standardised import Evidence


def about_mechanics(model: PushModel) -> PushModel:
    """The model trained again on its own training windows, with fitted mechanics as its mean.

    A learnt function of the inputs knows nothing outside them; mechanics do. Unchanged if it has mechanics already, or
    effects.
    """
    predictor = model.predictor
    if not (isinstance(predictor, GaussianProcessPredictor) and predictor.absorbs):
        return model
    options = TrainingOptions(seed=model.provenance.seed, mean="mechanics")
    sources = model.provenance.sources
    return train_model(model.training, model.rig, model.kind, name=model.name, sources=sources, options=options)


def widened(evidence: Evidence, model: PushModel, shift: InputShift) -> Evidence:
    """The evidence with predicted deviations in proportion to the tip's travel, where that is beyond training.

    Unchanged if those of the model grow with the travel already.
    """
    if _grows(model) or not any(each.covariate == "velocity" and each.extrapolates for each in shift.inputs):
        return evidence
    longest = float(np.max(model.training.inputs[:, 0] * model.training.duration))
    travel = evidence.table.inputs[:, 0] * evidence.table.duration
    factor = np.where(shift.outside, np.maximum(travel / longest, 1.0), 1.0)
    return replace(evidence, whitener=evidence.whitener / factor[:, None, None])


def _grows(model: PushModel) -> bool:
    """Whether predicted deviations grow with the travel: not if outcomes were learnt as they are, nor of mechanics."""
    base = model.predictor.base
    if isinstance(base, GaussianProcessPredictor):
        return base.scaling.travel is not None
    return not isinstance(base, MechanicsPredictor)
