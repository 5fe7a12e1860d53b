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
from push_predictor.models.tabulated.prediction_table import (
    FASTEST,
    PredictionTable,
    TooFineError,
    narrow_box,
    prediction_table,
    wide_box,
)
from push_predictor.types import Array, BoolArray

COMPUTED = "computed: only what is learnt has a table"
REFINEMENTS = (0.8, 1.0, 1.3, 1.7, 2.2)  # of a table, tried in turn
MEAN_TOLERANCE = 1e-3  # predicted standard deviations
COVARIANCE_TOLERANCE = 1e-2  # relative, of the variance of any combination of outputs
STEEPEST = 1.57  # rad, angle of a push to be compared
CHECKED = 250  # random pushes of the domain, as many training pushes, and as many outside the domain


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
        """Like PushModel.predict_rows; in its table within the tolerances above, elsewhere the same.

        Of a model with effects or with mechanics as its mean, what is learnt is tabulated, and the rest computed.
        """
        push, model = Push(inputs, duration, covariates or {}), self.model
        if self.table is None:
            return model.predict_rows(inputs, duration, covariates)
        predictor = model.predictor
        moments = predictor.with_effects(predictor.base.of_outcomes(self._learnt(inputs, duration), push), push)
        return Prediction(*moments, model.supported(push), predictor.tails)

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


@dataclass(frozen=True)
class TableAccuracy:
    """The largest differences found between table and model, or those that most pushes do not exceed.

    mean: in predicted standard deviations. covariance: relative error of the variance of any combination of outputs,
    which is the largest absolute eigenvalue of L^-1 T L^-T - I, where T is the table's covariance and L L' the model's.
    """

    mean: float
    covariance: float

    @property
    def accepted(self) -> bool:
        """Whether a table with these errors may be used: at half the tolerances, since not every push was compared."""
        return self.mean <= 0.5 * MEAN_TOLERANCE and self.covariance <= 0.5 * COVARIANCE_TOLERANCE

    def __str__(self) -> str:
        return f"means to {self.mean:.2g} standard deviations, covariances to {100.0 * self.covariance:.2g} %"


@dataclass(frozen=True, eq=False)
class Probes:
    """Pushes (n, 3) and what the model itself predicts: mean (n, 3) and covariances (n, 3, 3), SI units."""

    inputs: Array
    mean: Array
    covariance: Array
    process_covariance: Array

    def error_of(self, table: PredictionTable) -> TableAccuracy:
        """The largest differences of a table from the model, at the pushes that the table contains.

        Raises ValueError if that is none of them.
        """
        known = Probes(*(values[table.covered(self.inputs)] for values in vars(self).values()))
        found = table.moments(known.inputs)
        if found is None or not len(known.inputs):
            raise ValueError("none of the pushes is in the table")
        sd = np.sqrt(np.diagonal(known.covariance, axis1=1, axis2=2))
        of_mean = np.max(np.abs(found.mean - known.mean) / sd)
        of_outcome = relative_error(found.covariance, known.covariance)
        of_process = relative_error(found.process_covariance, known.process_covariance)
        return TableAccuracy(float(of_mean), float(max(of_outcome.max(), of_process.max())))


def outside_pushes(model: PushModel, count: int) -> Array:
    """At most `count` pushes (n, 3) outside the domain, of all contacts and angles, and speeds as in a wide table."""
    low, high = [0.0, 0.0, -STEEPEST], [FASTEST * float(model.training.inputs[:, 0].max()), 1.0, STEEPEST]
    spread = np.random.default_rng(0).uniform(low, high, (20 * count, 3))
    return np.asarray(spread[~model.in_domain(spread)][:count])


def probed(model: PushModel, count: int = CHECKED) -> Probes:
    """What a model predicts at pushes spread evenly over its domain, at training pushes, and at pushes outside.

    At most `count` of each.
    """
    rng, known = np.random.default_rng(0), model.training.inputs
    spread = rng.uniform(*narrow_box(model), (20 * count, 3))
    spread = spread[model.in_domain(spread)][:count]
    inputs = np.concatenate([spread, rng.permutation(known)[:count], outside_pushes(model, count)])
    exact = model.predict_rows(inputs, np.full(len(inputs), model.usual_duration))
    return Probes(inputs, exact.mean, exact.covariance, exact.process_covariance)


def relative_error(found: Array, exact: Array) -> Array:
    """Largest relative error (n,) of covariances (n, 3, 3) in the variance of any combination of outputs."""
    whitener = np.linalg.inv(np.linalg.cholesky(exact))
    eigenvalues = np.linalg.eigvalsh(whitener @ found @ whitener.transpose(0, 2, 1))
    return np.asarray(np.abs(eigenvalues - 1.0).max(axis=1))
