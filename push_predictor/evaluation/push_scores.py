"""What predictions come to, push by push: sums that pool over folds and resample by whole pushes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from push_predictor.evaluation.metrics import COVERAGE_LEVELS, gaussian_nlpd
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.evaluation.validation import Comparison, by_push
from push_predictor.types import Array


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
        """Figures for each row of weights (d, p) that says how often a push counts; each push once if None."""
        w = np.ones((1, len(self.windows))) if weights is None else weights
        count = w @ self.windows

        def mean(sums: Array) -> Array:
            return np.asarray((w @ sums) / count[:, None])

        shares = np.stack([mean(self.covered[..., k]) for k in range(len(COVERAGE_LEVELS))], axis=-1)
        return PooledScores((w @ self.error) / (w @ self.spread), mean(self.nlpd), mean(self.exact_nlpd), shares)

    def resampled(self, seed: int = 0) -> PooledScores:
        """Figures of 1000 draws of whole pushes with replacement; the same pushes drawn for every tally of them."""
        return self.totals(push_bootstrap(self.push_id, seed))


@dataclass(frozen=True, eq=False)
class PooledScores:
    """Figures of d draws: nmse, nlpd, exact_nlpd (d, 3) by output, coverage (d, 3, levels)."""

    nmse: Array
    nlpd: Array
    exact_nlpd: Array
    coverage: Array


def tally(comparison: Comparison) -> PushScores:
    """Sum what was predicted and observed over the windows of each push."""
    c = comparison
    pushes, push = np.unique(c.push_id, return_inverse=True)
    nlpd = gaussian_nlpd(c.mean, c.variance, c.observed)
    exact = nlpd if c.exact_log_density is None else -c.exact_log_density
    away = np.abs(c.observed - c.mean) / np.sqrt(c.variance)
    covered = away[..., None] <= ndtri(0.5 + 0.5 * np.asarray(COVERAGE_LEVELS))
    columns = ((c.observed - c.mean) ** 2, (c.observed - c.training_mean) ** 2, nlpd, exact, covered.astype(np.float64))
    return PushScores(pushes, np.bincount(push).astype(np.float64), *(by_push(push, column) for column in columns))


def pooled(tallies: Sequence[PushScores]) -> PushScores:
    """The pushes of several tallies as one: of folds (each push once), or of seeds (a push as often as it was seen)."""
    names = np.concatenate([t.push_id for t in tallies])
    pushes, push = np.unique(names, return_inverse=True)

    def joined(field: str) -> Array:
        return by_push(push, np.concatenate([getattr(t, field) for t in tallies]))

    return PushScores(pushes, *(joined(f) for f in ("windows", "error", "spread", "nlpd", "exact_nlpd", "covered")))
