# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""KL divergence of models from repeated pushes: values, intervals and the rules of the verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array
from push_predictor_paper.data.repetitions import RepeatedGrid
from push_predictor_paper.estimate import Estimate, of_draws
from push_predictor_paper.fits.fit import Answer
from push_predictor_paper.section import Verdict
from push_predictor_paper.statistics.divergence import gaussian_kl, kl_of_mean, printed_kl
from push_predictor_paper.statistics.grid_maps import Statistic, block_weights, mean_of, median_of

TOO_WIDE, TOO_NARROW = 0.95, 2.42  # KL of three outputs with exact means and sds twice, or half, the true ones
STATISTICS: dict[str, Statistic] = {"mean": mean_of, "median": median_of}


@dataclass(frozen=True, eq=False)
class Divergences:
    """Of p pushes from models of s seeds, (s, p), three outputs together: nats; sd_ratio (s, p, 3) model / seen.

    weights (d, p): draws of blocks of neighbouring pushes, which share the error of a model.
    """

    correct: Array
    printed: Array
    of_mean: Array
    sd_ratio: Array
    weights: Array

    @property
    def of_sd(self) -> Array:
        """The part of the divergence (s, p) that remains with exact means."""
        return np.asarray(self.correct - self.of_mean)


def divergences(grid: RepeatedGrid, answers: Sequence[Answer]) -> Divergences:
    """Divergences of the models' answers, one a seed, from the pushes of the grid."""
    mean, sd = (np.array([getattr(cell, what) for cell in grid.seen]) for what in ("mean", "sd"))
    model_mean, model_sd = (np.array([getattr(answer, what) for answer in answers]) for what in ("mean", "sd"))
    correct, printed = (kl(mean, sd, model_mean, model_sd).sum(axis=2) for kl in (gaussian_kl, printed_kl))
    of_mean = kl_of_mean(mean, model_mean, model_sd).sum(axis=2)
    return Divergences(correct, printed, of_mean, model_sd / sd, block_weights(grid.seen))


def estimate(values: Array, statistic: Statistic, weights: Array, less: Array | None = None) -> Estimate:
    """Mean over seeds of a statistic of values (s, p), with interval from weights (d, p); minus that of `less`."""
    value, draws = by_seed(values, statistic).mean(), np.mean([statistic(seed, weights) for seed in values], axis=0)
    if less is None:
        return of_draws(float(value), draws)
    base = np.mean([statistic(seed, weights) for seed in less], axis=0)
    return of_draws(float(value - by_seed(less, statistic).mean()), draws - base)


def by_seed(values: Array, statistic: Statistic) -> Array:
    """A statistic (s,) over the pushes of values (s, p)."""
    return np.array([statistic(seed, np.ones((1, len(seed))))[0] for seed in values])


def lower(difference: Estimate, below: int, seeds: int) -> Verdict:
    """Verdict on whether a difference lies below 0, over pushes and in every seed."""
    if difference.high < 0.0:
        return "holds" if below == seeds else "holds in part"
    return "does not hold" if difference.low > 0.0 else "not decided"


def good(median: Estimate) -> Verdict:
    """Verdict on the median KL of a model."""
    if median.high < TOO_WIDE:
        return "holds"
    if median.high < TOO_NARROW:
        return "holds in part"
    return "does not hold" if median.low > TOO_NARROW else "not decided"
