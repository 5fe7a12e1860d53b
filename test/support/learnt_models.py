# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a learnt model was trained on."""

from __future__ import annotations

import numpy as np

from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.types import Array


def learnt(model: PushModel) -> GaussianProcessPredictor:
    """The predictor of a learnt model."""
    assert isinstance(model.predictor, GaussianProcessPredictor)
    return model.predictor


def targets(predictor: GaussianProcessPredictor) -> Array:
    """What the regressions were trained on (n, 3), SI."""
    scaled = np.column_stack([regression.outputs for regression in predictor.regressions])
    return np.asarray(scaled * predictor.scaling.outcome_sd + predictor.scaling.outcome_mean)
