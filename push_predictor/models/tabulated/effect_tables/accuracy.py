# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""How far a table of effects is from its model, at pushes between those of the training and at later ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.models.effects.covariate_range import CUMULATIVE
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors import Moments, Shift
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.effect_tables.table import EffectTable
from push_predictor.models.tabulated.table_accuracy import TableAccuracy, relative_error

MEAN_TOLERANCE = 0.2  # predicted standard deviations, in 99 of 100 pushes; the root of the mean square is a fifth of it
COVARIANCE_TOLERANCE = 0.1  # relative, of the variance of any combination of outputs, in 99 of 100 pushes
CHECKED, MOST = 400, 0.99  # pushes: training rows, and as many with other inputs; the part of them that must agree
RECHECKED, HALF = 10, 0.5  # the same, when a table is read


@dataclass(frozen=True, eq=False)
class Sample:
    """Pushes at which a table is compared with its model, the model's moments there, and the shift in them."""

    push: Push
    exact: Moments
    shift: Shift


def samples(model: PushModel, later: bool, count: int) -> list[Sample]:
    """Pushes between those of the training, and later ones if wanted."""
    push = _checked(model, count)
    pushes = [push, later_pushes(push)] if later else [push]
    return [Sample(push, model.predictor.moments(push), model.predictor.shift(push)) for push in pushes]


def errors_of(table: EffectTable, at: Sequence[Sample], quantile: float) -> TableAccuracy:
    """The differences that this part of each sample does not exceed, in the worst sample."""
    errors = [_errors(table, sample, quantile) for sample in at]
    return TableAccuracy(max(of_mean for of_mean, _ in errors), max(of_covariance for _, of_covariance in errors))


def _errors(table: EffectTable, sample: Sample, quantile: float) -> tuple[float, float]:
    exact, expected = sample.exact, sample.shift
    found = table.shift(sample.push, table.located(sample.push))
    sd = np.sqrt(np.diagonal(exact.covariance, axis1=1, axis2=2))
    of_mean = np.abs(found.mean - table.source.anchor(sample.push) - expected.mean) / sd
    of_covariance = relative_error(exact.covariance - expected.covariance + found.covariance, exact.covariance)
    return float(np.quantile(of_mean.max(axis=1), quantile)), float(np.quantile(of_covariance, quantile))


def accepted(errors: TableAccuracy, share: float = 1.0) -> bool:
    """Whether errors take at most this share of the tolerances."""
    return errors.within(share * MEAN_TOLERANCE, share * COVARIANCE_TOLERANCE)


def later_pushes(push: Push) -> Push:
    """The same pushes, with cumulative covariates increased by the length of their range."""
    grown = {
        name: column + (column.max() - column.min()) if name in CUMULATIVE else column
        for name, column in push.covariates.items()
    }
    return replace(push, covariates=grown)


def _checked(model: PushModel, count: int) -> Push:
    """Training rows, and rows with inputs drawn evenly between them."""
    rng, rows = np.random.default_rng(0), model.training
    known = rows.take(rng.integers(len(rows), size=2 * count))
    inputs = known.inputs.copy()
    low, high = rows.inputs.min(axis=0), rows.inputs.max(axis=0)
    low[1], high[1] = 0.0, 1.0
    inputs[count:] = rng.uniform(low, high, (count, 3))
    covariates = dict(known.covariates)
    if {"slider_heading", "push_heading"} <= set(covariates):
        normal = model.rig.outline.inward_normal(inputs[:, 1])
        covariates["push_heading"] = (
            covariates["slider_heading"] + np.arctan2(normal[:, 1], normal[:, 0]) + inputs[:, 2]
        )
    return model.predictor.completed(Push(inputs, np.full(len(inputs), model.usual_duration), covariates))
