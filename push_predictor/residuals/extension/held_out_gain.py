# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The gain of an extension on held-out pushes, in NMSE and in NLPD: only what its mean brings counts."""

from __future__ import annotations

from dataclasses import dataclass, replace

from push_predictor.evaluation.estimate import Estimate, Figure, difference_by_push, total_nlpd, total_nmse
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.evaluation.validation import Comparison, compare, comparison_of_moments
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.extension.recalibration import (
    Unseen,
    held_out_windows,
    new_windows,
    uncertainty_of_effects,
)
from push_predictor.residuals.outcome import Reference
from push_predictor.types import Array


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
    there, mean = uncertainty_of_effects(after, held_out), deployed.training_mean
    references: dict[Reference, Unseen] = {
        "deployed": new_windows(deployed, analysis),
        "refit": held_out_windows(refit),
    }
    found, scored = [], _moments_compared(after, held_out, mean)
    for name, unseen in references.items():
        widened = unseen.calibrated(uncertainty_of_effects(after, unseen.table))
        first = _moments_compared(widened, held_out, mean)
        alike = (
            _moments_compared(unseen.calibrated(), held_out, mean),
            replace(first, covariance=first.covariance + there),
        )
        nmse = _difference(alike[0], scored, total_nmse)
        found += [HeldOutGain(name, nmse, _difference(each, scored, total_nlpd)) for each in alike]
    return max(found, key=lambda each: each.nlpd.high)


def gain(
    refit: PushModel, after: PushModel, held_out: PushTable, training_mean: Array | None = None
) -> tuple[Estimate, Estimate]:
    """After minus refit in NMSE and in NLPD, with 95 % intervals from a paired bootstrap of pushes.

    training_mean (3,): the reference of the NMSE; the refit's if None.
    """
    reference = refit.training_mean if training_mean is None else training_mean
    first, second = (_moments_compared(model, held_out, reference) for model in (refit, after))
    return _difference(first, second, total_nmse), _difference(first, second, total_nlpd)


def compared(model: PushModel, table: PushTable, training_mean: Array) -> Comparison:
    """A model's predictions of a table; the NMSE is relative to this mean outcome (3,)."""
    return replace(compare(model, table), training_mean=training_mean)


def _moments_compared(model: PushModel, table: PushTable, training_mean: Array) -> Comparison:
    """The same without the exact density, which no gain needs."""
    seen = new_windows(model, table)
    return replace(comparison_of_moments(model, table, seen.mean, seen.covariance), training_mean=training_mean)


def _difference(first: Comparison, second: Comparison, figure: Figure) -> Estimate:
    return difference_by_push(push_scores(first), push_scores(second), figure)
