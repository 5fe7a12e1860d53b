# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Predicted deviations that fit pushes which the model did not see: only then do gains come from the mean alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

LEAST = 0.1  # of the factor without other uncertainty


@dataclass(frozen=True, eq=False)
class Unseen:
    """A model's predictions of n windows that it did not see: mean (n, 3) and covariance (n, 3, 3) in their table."""

    model: PushModel
    table: PushTable
    mean: Array
    covariance: Array

    def calibrated(self, extra: Array | None = None) -> PushModel:
        """The model with the base's deviations scaled by the factors of largest likelihood.

        extra (n, 3, 3): further covariance of these windows. The uncertainty of the effects stays as it is.
        """
        model, predictor = self.model, self.model.predictor
        of_effects = uncertainty_of_effects(model, self.table)
        own = np.diagonal(self.covariance - of_effects, axis1=1, axis2=2)
        other = np.diagonal(of_effects + (0.0 if extra is None else extra), axis1=1, axis2=2)
        square = (self.table.outcomes - self.mean) ** 2
        factor = np.array([_likeliest(*columns) for columns in zip(square.T, own.T, other.T, strict=True)])
        if isinstance(predictor, ExtendedPredictor):
            return replace(model, predictor=replace(predictor, scale=predictor.scale * factor))
        return replace(model, predictor=ExtendedPredictor(predictor.base, (), factor))


def new_windows(model: PushModel, table: PushTable) -> Unseen:
    """Predictions of a table that the model was not trained on."""
    prediction = model.predict_rows(table.inputs, table.duration, table.covariates)
    return Unseen(model, table, prediction.mean, prediction.covariance)


def held_out_windows(model: PushModel) -> Unseen:
    """Predictions of the model's training windows, each without its push."""
    mean, covariance, _ = model.held_out_moments()
    return Unseen(model, model.training, mean, covariance)


def uncertainty_of_effects(model: PushModel, table: PushTable) -> Array:
    """Covariance (n, 3, 3) of a table's outcomes that comes from the effects of a model."""
    return model.predictor.shift(Push(table.inputs, table.duration, table.covariates)).covariance


def _likeliest(square: Array, own: Array, other: Array) -> float:
    """The factor s of largest likelihood for squares (n,) with the variance s^2 own + other."""
    alone = float(np.sqrt(np.mean(square / own)))
    if not other.any():
        return alone

    def cost(share: float) -> float:
        variance = (share * alone) ** 2 * own + other
        return float(np.sum(np.log(variance) + square / variance))

    return alone * float(minimize_scalar(cost, bounds=(LEAST, 1.0), method="bounded", options={"xatol": 1e-4}).x)
