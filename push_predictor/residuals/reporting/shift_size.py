# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How far an effect shifts the outcome: root mean square over the windows of a table, with 95 % intervals."""

from __future__ import annotations

import numpy as np

from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint
from push_predictor.models.pushes import Push
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.residuals.evidence.standardised import mechanics_under
from push_predictor.residuals.outcome import Sized, Trace
from push_predictor.types import Array

DRAWS = 500
OUTPUT_UNITS = dict(zip(OUTPUTS, ("m", "m", "rad"), strict=True))


def shift_sizes(trace: Trace, effect: Effect, table: PushTable) -> tuple[Sized, ...]:
    """Root mean square shift of each output (m, m, rad); intervals from draws of the effect's coefficients."""
    on, push = mechanics_under(trace.model), Push(table.inputs, table.duration, table.covariates)
    together = joint(on, [effect], push)
    shift, design = together.shift, together.designs[0]
    rng = np.random.default_rng(0)
    none = np.zeros_like(effect.coefficients)
    draws = rng.multivariate_normal(none, effect.covariance, DRAWS, method="svd")
    spread = np.array([_size(shift + design @ draw) for draw in draws])
    low, high = np.quantile(spread, [0.025, 0.975], axis=0)
    size = _size(shift)
    low, high = np.minimum(low, size), np.maximum(high, size)  # draws of a small effect are all larger than it
    ends = zip(OUTPUTS, size.tolist(), low.tolist(), high.tolist(), strict=True)
    return tuple(Sized(f"root mean square shift of {o}", v, a, b, OUTPUT_UNITS[o]) for o, v, a, b in ends)


def _size(shift: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(shift**2, axis=0)))
