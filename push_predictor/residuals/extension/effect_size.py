# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The size of an effect in the physical unit of its mechanism."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.models.effects.effect import Effect
from push_predictor.models.mechanisms import mechanism_named
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.drivers import between_ends
from push_predictor.residuals.outcome import Sized
from push_predictor.types import Array

DRAWS = 2000


def size_of(effect: Effect, table: PushTable) -> Sized | None:
    """The mechanism's parameter, or its change along the covariate, with a 95 % interval; None if it is unknown.

    Constant: the parameter itself. One covariate: the change from its 5th to its 95th percentile. Headings, categories
    and maps: the largest difference over the windows. The size of several parameters is the length of their vector. The
    interval contains the errors of the mechanics, too.
    """
    if effect.mechanism is None:
        return None
    parameters = mechanism_named(effect.mechanism).parameters
    change = _change(effect, table)
    estimate = _length(effect.coefficients, change, len(parameters))
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(effect.coefficients, effect.covariance, size=DRAWS, method="svd")
    lengths = np.array([_length(row, change, len(parameters)) for row in drawn])
    low, high = np.quantile(lengths, [0.025, 0.975])
    sized = Sized(_name(effect), float(estimate), float(low), float(high), parameters[0].unit)
    sized = sized.with_errors_of_mechanics()
    return sized if len(parameters) == 1 else replace(sized, low=max(sized.low, 0.0))  # a length is never negative


def _name(effect: Effect) -> str:
    parameters = mechanism_named(str(effect.mechanism)).parameters
    many = f"{str(effect.mechanism).replace('_', ' ')}, length of its vector"
    name = parameters[0].name if len(parameters) == 1 else many
    return name if effect.basis.is_constant else f"{name}, change over {effect.covariate}"


def _change(effect: Effect, table: PushTable) -> Array:
    """Difference (m,) of the basis between the two ends that are compared."""
    basis = effect.basis
    if basis.is_constant:
        return np.ones(1)
    if (change := between_ends(basis, table)) is not None:
        return change
    values = basis.values(table.covariates, len(table))
    strength = values @ effect.coefficients.reshape(-1, values.shape[1])[0]
    return np.asarray(values[int(np.argmax(strength))] - values[int(np.argmin(strength))])


def _length(coefficients: Array, change: Array, count: int) -> float:
    """Change of one parameter with its sign, or the length of the change of several."""
    changes = coefficients.reshape(count, -1) @ change
    return float(changes[0]) if count == 1 else float(np.linalg.norm(changes))
