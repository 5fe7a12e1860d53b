# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The gain of an extension on held-out pushes, in NMSE and in NLPD: only what its mean brings counts.

Predicted deviations are made to fit pushes that the model did not see: only then do gains come from the mean alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize_scalar

from push_predictor.evaluation.estimate import Estimate, Figure, difference_by_push, total_nlpd, total_nmse
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.evaluation.validation import Comparison, compare, comparison_of_moments
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.outcome import Reference
from push_predictor.types import Array

LEAST = 0.1  # of the factor without other uncertainty


@dataclass(frozen=True)
class HeldOutGain:
    """After minus the reference, which is the better of the two models without the effects."""

    reference: Reference
    nmse: Estimate
    nlpd: Estimate


def held_out_gain(
    deployed: PushModel, refit: PushModel, after: PushModel, analysis: PushTable, held_out: PushTable
) -> HeldOutGain:
    """The gain over the deployed model and over the refit, whichever is less certain.

    An effect of size zero with its uncertainty improves an overconfident model too. So the predicted deviations of both
    references fit pushes that they did not see, with the uncertainty of the effects added and without it.
    """
    extended, mean = new_windows(after, held_out), deployed.training_mean
    references: dict[Reference, Unseen] = {
        "deployed": new_windows(deployed, analysis),
        "refit": held_out_windows(refit),
    }
    found, scored = [], extended.compared(mean)
    for name, unseen in references.items():
        seen = new_windows(unseen.model, held_out)
        alone = seen.scaled(unseen.factor()).compared(mean)
        widened = seen.scaled(unseen.factor(uncertainty_of_effects(after, unseen.table))).compared(mean)
        nmse = _difference(alone, scored, total_nmse)
        for each in (alone, replace(widened, covariance=widened.covariance + extended.of_effects)):
            found.append(HeldOutGain(name, nmse, _difference(each, scored, total_nlpd)))
    return max(found, key=lambda each: each.nlpd.high)


def compared(model: PushModel, table: PushTable, training_mean: Array) -> Comparison:
    """A model's predictions of a table; the NMSE is relative to this mean outcome (3,)."""
    return replace(compare(model, table), training_mean=training_mean)


def _difference(first: Comparison, second: Comparison, figure: Figure) -> Estimate:
    return difference_by_push(push_scores(first), push_scores(second), figure)


# --- predictions and their deviations ---------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Unseen:
    """A model's predictions of n windows that it did not see: mean (n, 3) and covariance (n, 3, 3) in their table."""

    model: PushModel
    table: PushTable
    mean: Array
    covariance: Array

    @cached_property
    def of_effects(self) -> Array:
        """The part (n, 3, 3) of the covariance that comes from the model's effects."""
        return uncertainty_of_effects(self.model, self.table)

    def factor(self, extra: Array | float = 0.0) -> Array:
        """Factors (3,) of largest likelihood on the base's deviations; that of the effects stays as it is.

        extra (n, 3, 3): further covariance of these windows.
        """
        own = np.diagonal(self.covariance - self.of_effects, axis1=1, axis2=2)
        other = np.diagonal(self.of_effects + extra, axis1=1, axis2=2)
        square = (self.table.outcomes - self.mean) ** 2
        return np.array([_likeliest(*columns) for columns in zip(square.T, own.T, other.T, strict=True)])

    def scaled(self, factor: Array) -> Unseen:
        """The predictions with the base's deviations times a factor (3,)."""
        own = np.outer(factor, factor) * (self.covariance - self.of_effects)
        return replace(self, covariance=own + self.of_effects)

    def calibrated(self) -> PushModel:
        """The model with the base's deviations times the factor of largest likelihood."""
        model, predictor, factor = self.model, self.model.predictor, self.factor()
        if isinstance(predictor, ExtendedPredictor):
            return replace(model, predictor=replace(predictor, scale=predictor.scale * factor))
        return replace(model, predictor=ExtendedPredictor(predictor.base, (), factor))

    def compared(self, training_mean: Array) -> Comparison:
        """The predictions next to the outcomes, without the exact density, which no gain needs."""
        comparison = comparison_of_moments(self.model, self.table, self.mean, self.covariance)
        return replace(comparison, training_mean=training_mean)


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
    return model.predictor.shift(Push.of(table)).covariance


def _likeliest(square: Array, own: Array, other: Array) -> float:
    """The factor s of largest likelihood for squares (n,) with the variance s^2 own + other."""
    alone = float(np.sqrt(np.mean(square / own)))
    if not other.any():
        return alone

    def cost(share: float) -> float:
        variance = (share * alone) ** 2 * own + other
        return float(np.sum(np.log(variance) + square / variance))

    return alone * float(minimize_scalar(cost, bounds=(LEAST, 1.0), method="bounded", options={"xatol": 1e-4}).x)
