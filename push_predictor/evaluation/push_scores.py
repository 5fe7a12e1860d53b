# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Scores of predictions by push: sums that can be pooled over folds and resampled by whole pushes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.metrics import COVERAGE_LEVELS, gaussian_nlpd
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.types import Array, TextArray

if TYPE_CHECKING:
    from push_predictor.evaluation.validation import Comparison


@dataclass(frozen=True, eq=False)
class PushScores:
    """Sums over the windows of each of p pushes.

    push_id (p,); windows (p,) their number; error, spread (p, 3): squared distance from the prediction and from the
    training mean; nlpd, exact_nlpd (p, 3): negative log densities, moment-matched and exact (the same for a Gaussian);
    covered (p, 3, 3): windows inside the central interval of each of COVERAGE_LEVELS (last axis).
    """

    push_id: np.ndarray
    windows: Array
    error: Array
    spread: Array
    nlpd: Array
    exact_nlpd: Array
    covered: Array

    def totals(self, weights: Array | None = None) -> PooledScores:
        """Pooled scores for each row of weights (d, p), how often each push counts; each push once if None."""
        w = np.ones((1, len(self.windows))) if weights is None else weights
        count = w @ self.windows

        def mean(sums: Array) -> Array:
            return np.asarray((w @ sums) / count[:, None])

        shares = np.stack([mean(self.covered[..., k]) for k in range(len(COVERAGE_LEVELS))], axis=-1)
        error, spread = w @ self.error, w @ self.spread
        nmse = np.divide(error, spread, out=np.full(error.shape, np.nan), where=spread > 0.0)
        return PooledScores(nmse, mean(self.nlpd), mean(self.exact_nlpd), shares)

    def resampled(self, seed: int = 0) -> PooledScores:
        """Pooled scores of 1000 bootstrap samples of whole pushes, the same for all models of these pushes.

        Fewer than two pushes have no samples.
        """
        return self.totals(samples_of(self.push_id, seed))


@dataclass(frozen=True, eq=False)
class PooledScores:
    """Scores of d bootstrap samples: nmse, nlpd, exact_nlpd (d, 3) by output, coverage (d, 3, levels)."""

    nmse: Array
    nlpd: Array
    exact_nlpd: Array
    coverage: Array


def push_scores(comparison: Comparison) -> PushScores:
    """Sum the scores of a comparison over the windows of each push."""
    c = comparison
    pushes, push = np.unique(c.push_id, return_inverse=True)
    nlpd = gaussian_nlpd(c.mean, c.variance, c.observed)
    exact = nlpd if c.exact_log_density is None else -c.exact_log_density
    covered = c.covered(COVERAGE_LEVELS)
    columns = ((c.observed - c.mean) ** 2, (c.observed - c.training_mean) ** 2, nlpd, exact, covered.astype(np.float64))
    return PushScores(pushes, np.bincount(push).astype(np.float64), *(by_push(push, column) for column in columns))


def samples_of(pushes: TextArray, seed: int = 0) -> Array:
    """How often (draws, p) each of p pushes counts in each bootstrap sample; no draws for fewer than two pushes."""
    return push_bootstrap(pushes, seed) if len(pushes) > 1 else np.empty((0, len(pushes)))


def push_means(push_id: TextArray, values: Array) -> tuple[list[str], Array]:
    """The pushes, sorted by name, and the mean (k,) of their windows' values (n,)."""
    names, push = np.unique(push_id, return_inverse=True)
    return names.tolist(), np.bincount(push, values) / np.bincount(push)


def resampled_means(push_id: TextArray, rows: Array) -> Array:
    """Means (draws, k) of rows (n, k) in bootstrap samples of whole pushes; no draws for fewer than two pushes."""
    pushes, push = np.unique(push_id, return_inverse=True)
    weights = samples_of(pushes)
    return np.asarray((weights @ by_push(push, rows)) / (weights @ np.bincount(push))[:, None])


def by_push(push: np.ndarray, rows: Array) -> Array:
    """Sums (p, ...) of rows (n, ...) over the rows of each push; push (n,) numbers them from 0."""
    sums = np.zeros((int(push.max(initial=-1)) + 1, *rows.shape[1:]))
    np.add.at(sums, push, rows)
    return sums


def pooled(parts: Sequence[PushScores]) -> PushScores:
    """Scores of several folds (each push once) or seeds (a push as often as it occurs) as one."""
    names = np.concatenate([part.push_id for part in parts])
    pushes, push = np.unique(names, return_inverse=True)

    def joined(field: str) -> Array:
        return by_push(push, np.concatenate([getattr(part, field) for part in parts]))

    return PushScores(pushes, *(joined(f) for f in ("windows", "error", "spread", "nlpd", "exact_nlpd", "covered")))
