# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rules of the quasi-static claims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.evaluation.push_scores import PushScores
from push_predictor.evaluation.splits import FOLDS, push_bootstrap
from push_predictor.types import Array
from push_predictor_paper.data.time_scaled import TURN, EqualTravel, number_of
from push_predictor_paper.estimate import Estimate, of_draws, total_nmse
from push_predictor_paper.section import Verdict

SLOW = 0.02  # m/s and below: the slowest pushes
NOTABLE = 0.1  # of a model's error
KEPT = 0.9  # share of a window on which the tip touches


@dataclass(frozen=True, eq=False)
class Judged:
    """Scores of models of growing brackets of speeds, all on the same held-out pushes.

    speeds: top speeds (m/s) of the brackets. numbers: their places in the plan. scores: by series, one per bracket.
    """

    speeds: tuple[float, ...]
    numbers: tuple[int, ...]
    scores: Mapping[str, Sequence[PushScores]]

    def same(self, series: str) -> Array:
        """NMSE (brackets, 1 + draws) of each bracket on held-out pushes of its own speeds; the first is the value."""
        return np.array([self._draws(series, k, self.numbers[: k + 1]) for k in range(len(self.speeds))])

    def slow(self, series: str) -> Array:
        """NMSE on the slowest pushes only."""
        slow = [n for n, speed in zip(self.numbers, self.speeds, strict=True) if speed <= 1.001 * SLOW]
        return np.array([self._draws(series, k, slow) for k in range(len(self.speeds))])

    def single(self, series: str, bracket: int, place: int) -> Array:
        """NMSE (1 + draws,) of one bracket's models on pushes of one speed."""
        return self._draws(series, bracket, self.numbers[place : place + 1])

    def _draws(self, series: str, bracket: int, numbers: Sequence[int]) -> Array:
        """The value, then its resamples of folds with their models, and of pushes within."""
        push_scores = self.scores[series][bracket]
        speed, push = np.array([number_of(name) for name in push_scores.push_id.tolist()]).T
        weights = _weights(push) * np.isin(speed, numbers)
        with np.errstate(invalid="ignore", divide="ignore"):  # a draw without any such push
            return total_nmse(push_scores.totals(weights))


def _weights(push: np.ndarray) -> Array:
    """Weights (1 + draws, p) of pushes: each once, then resampled folds and, within them, resampled pushes."""
    drawn = push_bootstrap(push)
    folds, fold = np.unique(push % FOLDS, return_inverse=True)
    count = len(folds)
    again = np.random.default_rng(1).multinomial(count, np.full(count, 1.0 / count), size=len(drawn))
    return np.vstack([np.ones(len(push)), drawn * again[:, fold]])


def estimated(draws: Array) -> Estimate:
    """Estimate from a value and its draws (1 + draws,); NaN draws are skipped."""
    known = draws[1:][np.isfinite(draws[1:])]
    return of_draws(draws[0], known) if len(known) else Estimate(float(draws[0]), np.nan, np.nan)


def turn_of(speeds: Sequence[float], curves: Array) -> Estimate:
    """The speed (m/s) at which curves (brackets, 1 + draws) are lowest, with interval."""
    lowest = np.argmin(np.where(np.isfinite(curves), curves, np.inf), axis=0)
    return estimated(np.asarray(speeds)[lowest])


def turning_bracket(speeds: Sequence[float]) -> int | None:
    """The last bracket whose top speed lies in the range of the paper's turn."""
    within = [k for k, speed in enumerate(speeds) if TURN[0] <= speed <= TURN[1]]
    return within[-1] if within else None


def helps_then_harms(gain: Estimate, harm: Estimate) -> Verdict:
    """Verdict. gain: NMSE of the slowest bracket minus that at the paper's turn; harm: of the widest minus the same."""
    seen = (gain.low > 0.0) + (harm.low > 0.0)
    if seen:
        return "holds" if seen == 2 else "holds in part"
    return "does not hold" if gain.high < 0.0 or harm.high < 0.0 else "not decided"


def turns_there(turn: Estimate) -> Verdict:
    """Verdict on whether the turn lies in the paper's range."""
    low, high = 0.999 * TURN[0], 1.001 * TURN[1]
    if low <= turn.low and turn.high <= high:
        return "holds"
    if turn.high < low or turn.low > high:
        return "does not hold"
    return "holds in part" if low <= turn.value <= high else "not decided"


def breaks_beyond(departures: Mapping[float, Estimate], error: float) -> Verdict:
    """Verdict: do outcomes depart notably from quasi-static ones beyond the paper's turn, and not before?"""
    slow = [d for speed, d in departures.items() if speed <= 1.001 * TURN[0]]
    fast = [d for speed, d in departures.items() if speed > 1.001 * TURN[1]]
    limit = NOTABLE * error
    if not (slow and fast and np.isfinite(limit)):
        return "not decided"
    if any(d.high < limit for d in fast):
        return "does not hold"
    if all(d.low > limit for d in fast):
        return "holds" if all(d.high < limit for d in slow) else "holds in part"
    return "not decided"


def lower(difference: Estimate) -> Verdict:
    """Verdict on whether a difference of errors lies below zero."""
    if difference.high < 0.0:
        return "holds"
    return "does not hold" if difference.low > 0.0 else "not decided"


def departure(slowest: EqualTravel, other: EqualTravel, kept_only: bool) -> tuple[Estimate, int]:
    """Squared distance of outcomes from those of the same pushes at the slowest speed, and the number of pushes.

    In units of the variance at the slowest speed, summed over outputs: the NMSE of a prediction whose only error is the
    quasi-static assumption. kept_only: only pushes that stayed in contact at both speeds.
    """
    kept = (slowest.touching >= KEPT) & (other.touching >= KEPT) if kept_only else np.ones(len(slowest.outcomes), bool)
    count = int(kept.sum())
    if count < 2:
        return Estimate(np.nan, np.nan, np.nan), count
    squared = ((other.outcomes - slowest.outcomes)[kept] ** 2 / slowest.outcomes.var(axis=0)).sum(axis=1)
    rows = np.random.default_rng(0).integers(0, count, (1000, count))
    return of_draws(float(squared.mean()), squared[rows].mean(axis=1)), count
