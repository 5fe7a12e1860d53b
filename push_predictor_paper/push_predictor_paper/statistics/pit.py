# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Coverage of intervals and probability integral transforms (PIT), both by push."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.evaluation.push_scores import PushScores, pooled, push_scores
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.evaluation.validation import compare, pit
from push_predictor.models.gaussian_process.prediction import exact_cdf
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, BoolArray
from push_predictor_paper.data.corpus import PushSet
from push_predictor_paper.estimate import Estimate, of_draws
from push_predictor_paper.fits.fit import Fit, split_of, trained

BARS = 10
EDGES = np.linspace(0.0, 1.0, BARS + 1)


@dataclass(frozen=True, eq=False)
class Pits:
    """PIT values of a fit for m held-out windows.

    push_id (m,); speed (m,) m/s; gaussian, exact (m, 3): the predicted probability of an outcome below the observed
    one, under the moment-matched Gaussian and under the exact predictive (the same where that is Gaussian).
    """

    push_id: np.ndarray
    speed: Array
    gaussian: Array
    exact: Array
    push_scores: PushScores


@dataclass(frozen=True, eq=False)
class Histogram:
    """Shares (BARS, 3) of the windows in bars of equal predicted probability, their 95 % intervals by push.

    misplaced (3,): the share of the windows that lies in the wrong bar, half the summed distance from flat;
    p (3,): how often that much comes of drawing pushes alone, from a flat histogram.
    """

    shares: Array
    low: Array
    high: Array
    misplaced: Array
    p: Array


def pits(pushes: PushSet, fit: Fit) -> Pits:
    """Train a model and compute the PIT of the held-out outcomes."""
    model = trained(pushes, fit)
    table = pushes.table.take(split_of(pushes, fit).test)
    comparison = compare(model, table)
    return Pits(table.push_id, table.inputs[:, 0], pit(comparison), exact_pit(model, table), push_scores(comparison))


def exact_pit(model: PushModel, table: PushTable) -> Array:
    """Probabilities (n, 3) of outcomes below a table's under the exact predictive; for a Gaussian one, `pit`'s."""
    if not isinstance(model.predictor, GaussianProcessPredictor):
        return pit(compare(model, table))
    push = Push(table.inputs, table.duration, table.covariates)
    scaled = model.predictor.standardised(push, table.outcomes)
    latent = model.predictor.latent(table.inputs)
    return np.column_stack([exact_cdf(prediction, scaled[:, k]) for k, prediction in enumerate(latent)])


def together(several: Sequence[Pits]) -> Pits:
    """The windows of several folds or seeds together."""
    return Pits(
        np.concatenate([p.push_id for p in several]),
        np.concatenate([p.speed for p in several]),
        np.concatenate([p.gaussian for p in several]),
        np.concatenate([p.exact for p in several]),
        pooled([p.push_scores for p in several]),
    )


def coverage(push_id: np.ndarray, probabilities: Array, level: float) -> list[Estimate]:
    """Coverage by output of the central intervals of probability `level`.

    push_id (m,), probabilities (m, 3). NaN where there are fewer than two pushes.
    """
    value, draws = _means(push_id, np.abs(2.0 * probabilities - 1.0) <= level)
    if len(draws) == 0:
        return [Estimate(float(v), np.nan, np.nan) for v in value]
    return [of_draws(float(v), d) for v, d in zip(value, draws.T, strict=True)]


def histogram(push_id: np.ndarray, probabilities: Array) -> Histogram:
    """Histogram of probabilities (m, 3) and its distance from flat; NaN with fewer than two pushes."""
    bar = np.clip((probabilities * BARS).astype(np.int64), 0, BARS - 1)
    shares, draws = _means(push_id, bar[:, None, :] == np.arange(BARS)[None, :, None])
    misplaced = _distance(shares - 1.0 / BARS)
    if len(draws) == 0:
        unknown = np.full_like(shares, np.nan)
        return Histogram(shares, unknown, unknown, misplaced, unknown[0])
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    by_chance = _distance(draws - shares) >= misplaced
    return Histogram(shares, low, high, misplaced, (1.0 + by_chance.sum(axis=0)) / (1.0 + len(draws)))


def _distance(away: Array) -> Array:
    """Half the sum of absolute distances over the bars, (..., BARS, 3) to (..., 3)."""
    return np.asarray(0.5 * np.abs(away).sum(axis=-2))


def _means(push_id: np.ndarray, marks: BoolArray) -> tuple[Array, Array]:
    """Means (...) of marks (m, ...), and of draws of whole pushes (d, ...); no draws of fewer than two pushes."""
    pushes, push = np.unique(push_id, return_inverse=True)
    if len(pushes) < 2:
        value = marks.mean(axis=0) if len(marks) else np.full(marks.shape[1:], np.nan)
        return value, np.zeros((0, *marks.shape[1:]))
    sums = np.zeros((len(pushes), *marks.shape[1:]))
    np.add.at(sums, push, marks)
    weights, windows = push_bootstrap(pushes), np.bincount(push)
    drawn = np.tensordot(weights, sums, axes=1)
    return marks.mean(axis=0), drawn / (weights @ windows).reshape(-1, *([1] * (marks.ndim - 1)))
