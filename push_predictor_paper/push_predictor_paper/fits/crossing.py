# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The training size from which a learning curve stays below another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.push_scores import PushScores
from push_predictor.types import Array
from push_predictor_paper.estimate import fold_weights


@dataclass(frozen=True)
class Crossing:
    """Training size with 95 % interval; `first` means "there or before", inf means "beyond the last size"."""

    value: float
    low: float
    high: float
    first: int
    last: int

    def estimate(self) -> Estimate:
        """For a verdict: a crossing beyond the last size lies no further than that for certain."""
        return Estimate(self.value, min(self.low, self.last), self.high)

    def text(self) -> str:
        """For a sentence: 95 (70 to 130)."""
        return f"{self._size_text(self.value)} ({self._size_text(self.low)} to {self._size_text(self.high)})"

    def _size_text(self, size: float) -> str:
        if not np.isfinite(size):
            return f"beyond {self.last}"
        return f"at most {self.first}" if size <= self.first else f"{size:.3g}"


def crossing(
    sizes: Sequence[int], learned: Sequence[Sequence[PushScores]], baseline: Sequence[Sequence[PushScores]]
) -> Crossing:
    """Training size from which the learned model's total NMSE stays below the baseline's.

    By size, by seed (fold) the scores of both on the same windows. The interval resamples pushes, the same for both
    and for all sizes and seeds, and the seeds as well.
    """
    gaps = [_gap(first, second) for first, second in zip(learned, baseline, strict=True)]
    value = below_zero_from(sizes, np.array([[gap[0] for gap in gaps]]))[0]
    draws = below_zero_from(sizes, np.column_stack([gap[1:] for gap in gaps]))
    low, high = np.quantile(draws, [0.025, 0.975], method="inverted_cdf")  # never the mean of a size and infinity
    return Crossing(float(value), float(low), float(high), sizes[0], sizes[-1])


def below_zero_from(sizes: Sequence[int], gaps: Array) -> Array:
    """Sizes (d,) from which gaps (d, sizes) stay below 0, linear in log n.

    The first size where all gaps lie below 0, inf where the last does not.
    """
    place = np.log(np.asarray(sizes, dtype=np.float64))
    below = np.logical_and.accumulate((gaps < 0.0)[:, ::-1], axis=1)
    after = below.sum(axis=1)  # number of sizes, counted from the last
    k = np.minimum(len(sizes) - after, len(sizes) - 1)
    rows, before = np.arange(len(gaps)), np.maximum(k - 1, 0)
    ahead, at = gaps[rows, before], gaps[rows, k]
    share = np.divide(ahead, ahead - at, out=np.ones(len(gaps)), where=(k > 0) & (after > 0))
    size = np.exp(place[before] + share * (place[k] - place[before]))
    return np.where(after > 0, np.where(k == 0, float(sizes[0]), size), np.inf)


def _gap(learned: Sequence[PushScores], baseline: Sequence[PushScores]) -> Array:
    """Total NMSE of the first minus that of the second, (1 + draws,): the value, then each draw."""
    fold = np.repeat(np.arange(len(learned)), [len(scores.push_id) for scores in learned])
    weights = fold_weights(np.concatenate([scores.push_id for scores in learned]), fold)
    return _total(learned, weights) - _total(baseline, weights)


def _total(folds: Sequence[PushScores], weights: Array) -> Array:
    error, spread = (np.concatenate(sums) for sums in zip(*((s.error, s.spread) for s in folds), strict=True))
    return np.asarray(((weights @ error) / (weights @ spread)).sum(axis=1))
