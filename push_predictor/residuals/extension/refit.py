# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The refit: the same model trained on the new pushes, without the effects; the fair reference of an extension."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor import __version__
from push_predictor.models.predictors import Predictor
from push_predictor.models.push_model import Provenance, PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.train import retrain_model, training_rows
from push_predictor.recordings.table import PushTable

FEWEST_ROWS, MOST_ROWS = 300, 500  # guard against a refit from too few rows, and against hours of it


def refit_base(model: PushModel, table: PushTable) -> PushModel:
    """Refit a model to these pushes in its own inputs alone; effects that it already has stay as they are.

    See `retrain_model` for what is estimated again. Raises TrainingError for too few rows.
    """
    predictor, table = model.predictor, spread_rows(model, table)
    if not predictor.effects:
        return retrain_model(model, table)
    shift, _ = predictor.shift(Push(table.inputs, table.duration, table.covariates))
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
