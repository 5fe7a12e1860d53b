# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A push model that predicts from a table, in microseconds.

A prediction of a learnt model reads six dense factors of n^2 / 2 numbers, but it is a smooth function of at most three
inputs. So it is tabulated once: for all contacts, all angles and up to twice the speeds of its training, or in its
domain alone where that would be too large. The table is compared with the model and used only if it is accurate. Every
other push is predicted by the model itself. Mechanics, alone, as the mean of a learnt model or under effects, are
integrated: the compiled kernel takes microseconds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors import GaussianProcessPredictor, Moments
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.tabulated.grid_posterior import OnGrid, on_grid
from push_predictor.models.tabulated.prediction_table import PredictionTable, narrow_box, prediction_table, wide_box
from push_predictor.models.tabulated.table_accuracy import Probes, TableAccuracy, probed
from push_predictor.models.tabulated.table_nodes import TooFineError
from push_predictor.types import Array, BoolArray

COMPUTED = "computed: only what is learnt has a table"
REFINEMENTS = (0.8, 1.0, 1.3, 1.7, 2.2)  # of a table, tried in turn


@dataclass(frozen=True, eq=False)
class TabulatedModel:
    """A model with its table; table and error are None if there is none.

    how: in words, how it predicts. A push gets the same prediction alone as among others. Made by `tabulate`.
    """

    model: PushModel
    how: str
    table: PredictionTable | None = None
    error: TableAccuracy | None = None

    @property
    def tabulated(self) -> bool:
        """Whether pushes are predicted from a table."""
        return self.table is not None

    def predict_rows(self, inputs: Array, duration: Array, covariates: Mapping[str, Array] | None = None) -> Prediction:
        """Like PushModel.predict_rows; in its table within the tolerances of table_accuracy, elsewhere the same.

        Of a model with effects or with mechanics as its mean, what is learnt is tabulated, and the rest computed.
        """
        push, model = Push(inputs, duration, covariates or {}), self.model
        if self.table is None:
            return model.predict_rows(inputs, duration, covariates)
        predictor = model.predictor
        moments = predictor.base.of_outcomes(self._learnt(inputs, duration), push)
        if predictor.effects:
            moments = predictor.with_effects(moments, push)
        return Prediction(*moments, model.in_domain(inputs) & model.covariates_seen(push), predictor.tails)

    def free_matrices(self) -> None:
        """Free the matrices of the model, 50 MB for a VHGP of 1000 rows, if it predicts from a table."""
        predictor = self.model.predictor.base
        if self.table is not None and isinstance(predictor, GaussianProcessPredictor):
            predictor.free_matrices()

    def exact_count(self, inputs: Array) -> int:
        """Number of the pushes (n, 3) that are predicted by the model itself, not from a table."""
        return len(inputs) if self.table is None else int(np.sum(~self.table.covered(inputs)))

    def _learnt(self, inputs: Array, duration: Array) -> Moments:
        """Moments of what the base has learnt, from the table where it can."""
        assert self.table is not None
        if (found := self.table.moments(inputs)) is not None:
            return found
        covered = self.table.covered(inputs)
        beyond = of_targets(self.model.base).predictor.moments(Push(inputs[~covered], duration[~covered], {}))
        if not covered.any():
            return beyond
        return _merged(covered, self._learnt(inputs[covered], duration[covered]), beyond)


def tabulate(model: PushModel) -> TabulatedModel:
    """The model with a table if it can have one; takes about a second for a VHGP of 1000 rows."""
    learnt = of_targets(model.base)
    if not isinstance(predictor := learnt.predictor, GaussianProcessPredictor):
        return TabulatedModel(model, COMPUTED)
    exact, posteriors = probed(learnt), [on_grid(regression) for regression in predictor.regressions]
    why = ""
    for ends in (wide_box(model, predictor), narrow_box(model)):
        found = _accurate(predictor, posteriors, ends, exact)
        if not isinstance(found, str):
            return with_table(model, *found)
        why = found
    return TabulatedModel(model, f"computed: {why}")


def _accurate(
    predictor: GaussianProcessPredictor, posteriors: Sequence[OnGrid], ends: tuple[Array, Array], exact: Probes
) -> tuple[PredictionTable, TableAccuracy] | str:
    """The coarsest table between these ends that is accurate, and its errors; else why there is none."""
    how = ""
    for refinement in REFINEMENTS:
        try:
            table = prediction_table(predictor, posteriors, ends, refinement)
        except TooFineError as too_fine:
            return f"{how}{too_fine}"
        error = exact.error_of(table)
        if error.accepted:
            return table, error
        how = f"a table gives {error}; "
    return f"{how}too far off"


def with_table(model: PushModel, table: PredictionTable, error: TableAccuracy) -> TabulatedModel:
    """The model with a table that was compared with it."""
    return TabulatedModel(model, f"table of {table.spline.knots} knots, {error}", table, error)


def of_targets(model: PushModel) -> PushModel:
    """The model of what is tabulated: what was learnt, at one path length and without the mechanics."""
    predictor = model.predictor
    if not isinstance(predictor, GaussianProcessPredictor):
        return model
    return replace(model, predictor=predictor.of_targets())


def _merged(chosen: BoolArray, one: Moments, other: Moments) -> Moments:
    """Row by row from `one` where chosen (n,), else from `other`."""
    parts = []
    for first, second in zip(one, other, strict=True):
        part = np.empty((len(chosen), *first.shape[1:]))
        part[chosen], part[~chosen] = first, second
        parts.append(part)
    return Moments(*parts)
