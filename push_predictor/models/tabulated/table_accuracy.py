# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How far a table's predictions are from those of its model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.prediction_table import FASTEST, PredictionTable
from push_predictor.types import Array

MEAN_TOLERANCE = 1e-3  # predicted standard deviations
COVARIANCE_TOLERANCE = 1e-2  # relative, of the variance of any combination of outputs
STEEPEST = 1.57  # rad, angle of a push to be compared
CHECKED = 250  # random pushes of the domain, as many training pushes, and as many outside the domain


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
    low, high = known.min(axis=0), known.max(axis=0)
    low[1], high[1] = 0.0, 1.0
    spread = rng.uniform(low, high, (20 * count, 3))
    spread = spread[model.in_domain(spread)][:count]
    inputs = np.concatenate([spread, rng.permutation(known)[:count], outside_pushes(model, count)])
    exact = model.predict_rows(inputs, np.full(len(inputs), model.usual_duration))
    return Probes(inputs, exact.mean, exact.covariance, exact.process_covariance)


def relative_error(found: Array, exact: Array) -> Array:
    """Largest relative error (n,) of covariances (n, 3, 3) in the variance of any combination of outputs."""
    whitener = np.linalg.inv(np.linalg.cholesky(exact))
    eigenvalues = np.linalg.eigvalsh(whitener @ found @ whitener.transpose(0, 2, 1))
    return np.asarray(np.abs(eigenvalues - 1.0).max(axis=1))
