# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How far a table's predictions are from those of its model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.models.prediction import Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.tabulated_domain import FASTEST, TabulatedDomain
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
        return self.within(0.5 * MEAN_TOLERANCE, 0.5 * COVARIANCE_TOLERANCE)

    def within(self, mean: float, covariance: float) -> bool:
        """Whether they are at most these."""
        return self.mean <= mean and self.covariance <= covariance

    def __str__(self) -> str:
        return f"means to {self.mean:.2g} standard deviations, covariances to {100.0 * self.covariance:.2g} %"


@dataclass(frozen=True, eq=False)
class Probes:
    """Pushes (n, 3) and what the model itself predicts: mean (n, 3) and covariances (n, 3, 3), SI units."""

    inputs: Array
    mean: Array
    covariance: Array
    process_covariance: Array

    def error_of(self, domain: TabulatedDomain) -> TableAccuracy:
        """The largest differences of a table from the model, at the pushes that the table contains.

        Raises ValueError if that is none of them.
        """
        covered = domain.covered(self.inputs)
        known = (
            self if covered.all() else Probes(*(getattr(self, field)[covered] for field in self.__dataclass_fields__))
        )
        table = domain.moments(known.inputs)
        if table is None or not len(known.inputs):
            raise ValueError("none of the pushes is in the table")
        return compared_with(known, *table)


def compared_with(
    exact: Probes | Prediction, mean: Array, covariance: Array, process_covariance: Array
) -> TableAccuracy:
    """The largest differences of means (n, 3) and covariances (n, 3, 3) from exact ones."""
    sd = np.sqrt(np.diagonal(exact.covariance, axis1=1, axis2=2))
    of_mean = np.max(np.abs(mean - exact.mean) / sd)
    of_outcome = relative_error(covariance, exact.covariance)
    of_process = relative_error(process_covariance, exact.process_covariance)
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
