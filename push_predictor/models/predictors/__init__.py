# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a push model predicts with: learnt (Gaussian processes), analytical, prior, or one of them extended by effects.

Callers use what all of them have, as `BasePredictor` describes it. This folder may import from gaussian_process,
mechanics, mechanisms and effects.
"""

from __future__ import annotations

from push_predictor.models.features import Scaling
from push_predictor.models.predictors.extended_predictor import ExtendedPredictor, Predictor
from push_predictor.models.predictors.gaussian_process_predictor import GaussianProcessPredictor
from push_predictor.models.predictors.predictor import (
    BasePredictor,
    Cross,
    InputLimits,
    MechanicsPredictor,
    Moments,
    Shift,
)
from push_predictor.models.predictors.prior_predictor import PriorPredictor
from push_predictor.models.predictors.tails import Tails

__all__ = [
    "BasePredictor",
    "Cross",
    "ExtendedPredictor",
    "GaussianProcessPredictor",
    "InputLimits",
    "MechanicsPredictor",
    "Moments",
    "Predictor",
    "PriorPredictor",
    "Scaling",
    "Shift",
    "Tails",
]
