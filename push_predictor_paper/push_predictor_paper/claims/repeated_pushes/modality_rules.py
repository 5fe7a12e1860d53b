# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The number of modes of repeated pushes and the loss of a Gaussian: values, and the rules of the verdicts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from push_predictor.types import Array
from push_predictor_paper.data.repetitions import Repetitions
from push_predictor_paper.estimate import Estimate, of_draws
from push_predictor_paper.section import Verdict
from push_predictor_paper.statistics.densities import LogDensities, Shape

LEVEL = 0.05
FAR, POWER = 6.0, 0.8  # two equal modes so many of their sd apart should be found so often
GOOD, POOR = 0.16, 0.32  # nats an outcome; 0.32 is the cost of an sd twice too wide


def model_loss(cells: Sequence[Repetitions], at: Shape, of_model: Sequence[LogDensities]) -> Array:
    """Mean log density (p, 3) that the model's Gaussian loses to the better fit to the push itself."""
    model = [logs.gaussian[: len(c.outcomes)].mean(axis=0) for c, logs in zip(cells, of_model, strict=True)]
    return np.asarray(at.own - np.array(model))


def mean_over_pushes(values: Array, weights: Array) -> Estimate:
    """Mean of the finite ones of values (p, k), pushes resampled by weights (d, p); draws without any are skipped."""
    sums, counts = np.nansum(values, axis=1), np.sum(np.isfinite(values), axis=1)
    total = weights @ counts
    drawn = (weights @ sums)[total > 0.0] / total[total > 0.0]
    return of_draws(float(sums.sum() / counts.sum()), drawn)


def some_modes(in_window: int, at_end: int, power_far: float) -> Verdict:
    """Verdict by the number of pushes with several modes and the power of the test."""
    if in_window > 0:
        return "holds"
    if at_end > 0:
        return "holds in part"
    return "does not hold" if power_far >= POWER else "not decided"


def not_gaussian(certain: int, share: Estimate) -> Verdict:
    """Verdict by the number of pushes that are clearly not Gaussian and the share of single tests that reject."""
    if certain > 0:
        return "holds"
    if share.low > LEVEL:
        return "holds in part"
    return "does not hold" if share.high < 2.0 * LEVEL else "not decided"


def good_gaussian(given_away: Estimate) -> Verdict:
    """Verdict by the loss against a push's own fit."""
    if given_away.high < GOOD:
        return "holds"
    if given_away.high < POOR:
        return "holds in part"
    return "does not hold" if given_away.low > POOR else "not decided"
