"""The gain of an extension on held-out pushes: extended model minus refit, in NMSE and in NLPD."""

from __future__ import annotations

from dataclasses import replace

from push_predictor.evaluation.estimate import Figure, difference_by_push, total_nlpd, total_nmse
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.evaluation.validation import Comparison, compare
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.outcome import Gain
from push_predictor.types import Array


def gain(
    refit: PushModel, after: PushModel, held_out: PushTable, training_mean: Array | None = None
) -> tuple[Gain, Gain]:
    """After minus refit in NMSE and in NLPD, with 95 % intervals from a paired bootstrap of pushes.

    training_mean (3,): the reference of the NMSE; the refit's if None.
    """
    reference = refit.training_mean if training_mean is None else training_mean
    first, second = (push_scores(compared(model, held_out, reference)) for model in (refit, after))

    def difference(figure: Figure) -> Gain:
        return Gain(**vars(difference_by_push(first, second, figure)))

    return difference(total_nmse), difference(total_nlpd)


def compared(model: PushModel, table: PushTable, training_mean: Array) -> Comparison:
    """A model's predictions of a table; the NMSE is relative to this mean outcome (3,)."""
    return replace(compare(model, table), training_mean=training_mean)
