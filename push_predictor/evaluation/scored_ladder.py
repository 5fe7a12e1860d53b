# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A ladder of fitted mechanics with the held-out scores of its steps and the fitted parameters with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.evaluation.estimate import NORMAL_95, Estimate, by_push, total_nlpd, total_nmse
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.evaluation.validation import Comparison
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.ladder import CrossValidation, Rung
from push_predictor.models.mechanics.parameters import BY_NAME, MechanicsParameter
from push_predictor.models.predictors import MechanicsPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.types import Array


@dataclass(frozen=True)
class FittedParameter:
    """A parameter with its fitted value and 95 % interval."""

    parameter: MechanicsParameter
    estimate: Estimate


@dataclass(frozen=True, eq=False)
class ScoredStep:
    """A step of the ladder. gain: in held-out log density, nats per push; None for the textbook.

    nmse, nlpd: totals over the outputs under push-blocked cross-validation, with intervals from resampling pushes.
    """

    rung: Rung
    parameters: list[FittedParameter]
    nmse: Estimate
    nlpd: Estimate
    gain: Estimate | None

    @property
    def change(self) -> str:
        """What the step changes, in words."""
        return changed(self.rung.added, self.rung.dropped)


@dataclass(frozen=True, eq=False)
class ScoredLadder:
    """The ladder of a model. windows, pushes: of the search; final: parameters fitted to all training windows."""

    model: PushModel
    windows: int
    pushes: int
    steps: list[ScoredStep]
    final: list[FittedParameter]


def score_ladder(model: PushModel, ladder: Sequence[Rung]) -> ScoredLadder:
    """Score the steps of the ladder that chose a model's parameters, on the rows of its search."""
    assert isinstance(model.predictor, MechanicsPredictor)
    fitted, rows = model.predictor.fitted, ladder[0].fit.rows
    return ScoredLadder(model, len(rows.push), rows.pushes, [_scored(rung) for rung in ladder], _final(fitted))


def changed(added: Sequence[str], dropped: Sequence[str]) -> str:
    """A change of the free parameters in words."""
    if not added:
        return f"without {', '.join(dropped)}" if dropped else "textbook"
    return " and ".join(added) + (f" in place of {', '.join(dropped)}" if dropped else "")


def _scored(rung: Rung) -> ScoredStep:
    scores = push_scores(_held_out(rung))
    pushes = rung.fit.rows.pushes
    half = NORMAL_95 * rung.error
    gain = Estimate(*(value / pushes for value in (rung.gain, rung.gain - half, rung.gain + half)))
    parameters = _parameters(rung.fit.values, rung.fit.covariance)
    textbook = not (rung.added or rung.dropped)
    return ScoredStep(
        rung, parameters, by_push(scores, total_nmse), by_push(scores, total_nlpd), None if textbook else gain
    )


def _held_out(rung: Rung) -> Comparison:
    """Predictions of each push without its fold; their covariance too is that of the residuals of the other folds."""
    known, rows = CrossValidation(rung.fit), rung.fit.rows
    residuals = known.residuals(rung.fit.names)
    covariance = np.zeros((len(residuals), 3, 3))
    for fold in np.unique(known.fold):
        others = residuals[known.fold != fold] if known.fold.any() else residuals  # a single push has no others
        covariance[known.fold == fold] = others.T @ others / len(others)
    mean = rows.outcomes - residuals
    names, reference = rows.push.astype(str), rows.outcomes.mean(axis=0)
    return Comparison("ladder", len(residuals), names, mean, covariance, rows.outcomes, None, reference)


def _final(fitted: FittedMechanics) -> list[FittedParameter]:
    return _parameters(fitted.values, fitted.covariance)


def _parameters(values: dict[str, float], covariance: Array) -> list[FittedParameter]:
    half = NORMAL_95 * np.sqrt(np.diagonal(covariance))
    return [
        FittedParameter(BY_NAME[name], Estimate(value, value - h, value + h))
        for (name, value), h in zip(values.items(), half.tolist(), strict=True)
    ]
