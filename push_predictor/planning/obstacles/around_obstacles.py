# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Plan a sequence of pushes to a target, past obstacles and the table's edges, at a bounded risk.

Beam search over sequences of pushes of a repertoire. The belief of a sequence is a set of samples: each push adds a
draw of its predicted Gaussian in the slider's frame. A sequence is dropped as soon as more than `risk` of its samples
have touched an obstacle or fallen from the table (a chance constraint). Of the others, that with the largest score

    (probability to end in the target without touching or falling) - PUSH_COST * (number of pushes)

is returned. The samples of the search favour the sequences that they choose, so the best are judged again with new
ones. Without noise all probabilities are 0 or 1, and `margin` keeps the predicted outline away from obstacles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.planning.choose import SMALLEST_PUSH
from push_predictor.planning.obstacles.belief import Beliefs, after_displacement, certain
from push_predictor.planning.obstacles.cost_to_go import CostToGo, cost_to_go
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.planning.obstacles.targets import Target
from push_predictor.planning.repertoire import Repertoire, StraightPushes
from push_predictor.planning.unscented import FLOOR
from push_predictor.types import Array, BoolArray, IntArray

SEARCH_DRAWS, FINAL_DRAWS = 64, 512  # the first a power of two up to 256, for Sobol points
BEAM = 12  # sequences kept of each length
PER_LENGTH = 24  # pushes tried of each number of windows, over the whole beam
SCREENED = 15  # times as many are compared by their means first
SAME_PLACE, SAME_HEADING = 0.003, 0.05  # m, rad: of pushes with means this close the least noisy is tried
WEIGHTS = (0.0, 0.5, 2.0)  # pushes for one standard deviation of an average push: some options are quick, some sure
NOISE_COST = 0.3  # pushes for a standard deviation of an average push, in a belief
CAUTIONS = (1.0, 0.2)  # weights of risk and noise in the beam; the second if the first finds no sequence
FINALISTS = 8  # sequences judged again
PUSH_COST = 0.02  # probability that one push less is worth
TIE = 1e-3  # probability for one push of remaining distance to the target's middle


@dataclass(frozen=True, eq=False)
class PlannedPushes:
    """A sequence of k pushes.

    poses (k + 1, 3): from the start, as predicted without noise. samples (k, p, 3): poses after each push. risk (k,):
    probability that the slider has touched an obstacle or fallen by the end of each push. probability: to end in the
    target without.
    """

    pushes: StraightPushes
    poses: Array
    samples: Array
    risk: Array
    probability: float

    def __str__(self) -> str:
        ahead = f"{len(self.pushes)} pushes, which end in the target with probability {self.probability:.2f}"
        rows = zip(self.pushes.inputs, self.pushes.windows, self.poses[1:], self.risk, strict=True)
        lines = [
            f"contact {contact:.3f}, angle {angle:+.2f} rad, {1e3 * velocity:.1f} mm/s, for {windows} windows; "
            f"then slider at x {x:.4f} m, y {y:.4f} m, heading {heading:.3f} rad; risk until then {risk:.3f}"
            for (velocity, contact, angle), windows, (x, y, heading), risk in rows
        ]
        return "\n".join([f"Plan: {ahead}", *(f"  {count}: {line}" for count, line in enumerate(lines, 1))])


def plan_around_obstacles(
    repertoire: Repertoire,
    scene: Scene,
    slider: Array,
    target: Target,
    risk: float = 0.05,
    *,
    margin: float = 0.0,
    observed: bool = False,
    most_pushes: int = 8,
) -> PlannedPushes | None:
    """Plan pushes for a slider at (3: x, y m, heading rad); None if no sequence reaches the target at this risk.

    margin: m that the slider keeps from obstacles and its centre from edges, at most its clearance at the start.
    observed: whether the slider will be observed, and the plan made again, after every push; then each push starts
    from its predicted pose, and only its own noise counts. Otherwise noise adds up over the pushes. The pusher is
    placed relative to the slider in both cases. Raises RequestError for a value out of range and for a slider that
    touches an obstacle or lies off the table at the start.
    """
    slider = np.asarray(slider, dtype=np.float64)
    _check(scene, slider, risk, margin, most_pushes)
    margin = min(margin, 0.999 * float(scene.clearance(slider)))
    search = _Search(repertoire, scene, target, margin, observed)
    for caution in CAUTIONS if search.draws > 1 else CAUTIONS[:1]:
        finalists = search.finalists(slider, risk, most_pushes, caution)
        plans = [search.judged(slider, rows) for rows in finalists]
        plans = [plan for plan in plans if plan.risk[-1] <= risk and plan.probability > 0.0]
        if plans:
            return max(plans, key=lambda plan: plan.probability - PUSH_COST * len(plan.pushes))
    return None


@dataclass(frozen=True, eq=False)
class _Search:
    repertoire: Repertoire
    scene: Scene
    target: Target
    margin: float
    observed: bool

    @property
    def draws(self) -> int:
        """Samples of a belief in the search; one is enough without noise."""
        return SEARCH_DRAWS if self.repertoire.covariance.any() else 1

    @property
    def costs(self) -> CostToGo:
        """Costs to the target in pushes of the repertoire."""
        return _costs(self.repertoire, self.scene, self.target)

    def finalists(self, slider: Array, risk: float, most_pushes: int, caution: float) -> list[list[int]]:
        """The rows of the sequences with the largest scores, found with a beam of that caution."""
        beam = certain(slider, self.draws)
        done: list[tuple[float, list[int]]] = []
        for depth in range(1, most_pushes + 1):
            tried = self.grown(beam)
            tried = tried.take(tried.risk <= risk)
            done += zip(self.scores(tried).tolist(), tried.rows.tolist(), strict=True)
            if not len(tried) or max(done)[0] >= 1.0 - PUSH_COST * (depth + 1):
                break
            ahead = self.costs.at(tried.samples[:, :16]).mean(axis=1) + caution * self.penalty(tried)
            beam = tried.take(ahead.argsort(kind="stable")[:BEAM])
        best = sorted(done, reverse=True)[:FINALISTS]
        return [rows for score, rows in best if score > -PUSH_COST * len(rows)]

    def grown(self, beam: Beliefs) -> Beliefs:
        """The beliefs after one more push of the screened candidates."""
        parents, rows = self._screened(beam.mean)
        if beam.rows.shape[1] and self.observed:
            beam = beam.observed()
        order = np.random.default_rng(beam.rows.shape[1]).permutation(self.draws)  # pushes are independent
        outcomes, mean = self.repertoire.outcomes[rows][:, order], self.repertoire.mean[rows]
        return beam.take(parents).pushed(rows, mean, outcomes, self.scene, self.margin)

    def scores(self, tried: Beliefs) -> Array:
        """Scores (n,) of the module's text; ties go to the sequence that ends nearest to the target's middle."""
        score = self._probability(tried) - PUSH_COST * tried.rows.shape[1]
        distance, turn = self.target.remaining(tried.mean)
        return np.asarray(score - TIE * (distance / self.costs.longest + turn / self.costs.widest))

    def penalty(self, tried: Beliefs) -> Array:
        """Risk and noise (n,) counted as pushes."""
        noise = 0.0 if self.observed else _noise(self.repertoire, tried.samples.var(axis=1))
        return np.asarray(NOISE_COST * noise + tried.risk / PUSH_COST)

    def judged(self, slider: Array, rows: list[int]) -> PlannedPushes:
        """A sequence with new samples."""
        belief, rng = certain(slider, FINAL_DRAWS), np.random.default_rng(len(rows))
        poses, samples, risk = [slider], [], []
        for count, row in enumerate(rows):
            belief = belief.observed() if count and self.observed else belief
            root = np.linalg.cholesky(self.repertoire.covariance[row] + FLOOR * np.eye(3))
            mean = self.repertoire.mean[row]
            outcomes = mean + rng.standard_normal((1, FINAL_DRAWS, 3)) @ root.T
            belief = belief.pushed(np.array([row]), mean[None], outcomes, self.scene, self.margin)
            poses.append(belief.mean[0])
            samples.append(belief.samples[0])
            risk.append(float(belief.risk[0]))
        pushes = self.repertoire.pushes.take(np.array(rows))
        return PlannedPushes(
            pushes, np.array(poses), np.array(samples), np.array(risk), float(self._probability(belief)[0])
        )

    def _probability(self, beliefs: Beliefs) -> Array:
        there = (self.target.reached(beliefs.samples) & beliefs.safe).mean(axis=1)
        return np.asarray(beliefs.survival * there)

    def _screened(self, poses: Array) -> tuple[IntArray, IntArray]:
        """Parents and rows of the pushes to try from poses (b, 3): of each length those nearest to the target."""
        pairs = [self._nearest(poses, np.flatnonzero(rows)) for rows in _by_length(self.repertoire)]
        parents, rows = (np.concatenate(column) for column in zip(*pairs, strict=True))
        return parents, rows

    def _nearest(self, poses: Array, rows: IntArray) -> tuple[IntArray, IntArray]:
        after = after_displacement(poses[:, None], self.repertoire.mean[rows]).reshape(-1, 3)
        costs = self.costs.at(after)
        each = min(len(rows), SCREENED * PER_LENGTH // len(poses) + 1)
        nearest = np.argsort(costs.reshape(len(poses), -1), axis=1, kind="stable")[:, :each]
        kept = (nearest + len(rows) * np.arange(len(poses))[:, None]).ravel()
        kept = kept[self.scene.safe(after[kept], self.margin)]
        noise = _noise(self.repertoire, np.einsum("nii->ni", self.repertoire.covariance[rows]))[kept % len(rows)]
        places = np.rint(after[kept] / np.array([SAME_PLACE, SAME_PLACE, SAME_HEADING]))
        order = np.lexsort((costs[kept], noise))
        kept, noise = kept[order], noise[order]
        first = np.unique(places[order], axis=0, return_index=True)[1]
        kept, noise = kept[first], noise[first]
        kept = kept[_chosen(costs[kept], noise, kept // len(rows), PER_LENGTH)]
        return kept // len(rows), rows[kept % len(rows)]


@lru_cache(maxsize=4)
def _costs(repertoire: Repertoire, scene: Scene, target: Target) -> CostToGo:
    longest, widest = np.hypot(*repertoire.mean[:, :2].T).max(), np.abs(repertoire.mean[:, 2]).max()
    return cost_to_go(scene, target, max(float(longest), SMALLEST_PUSH), max(float(widest), SMALLEST_PUSH))


@lru_cache(maxsize=4)
def _by_length(repertoire: Repertoire) -> list[BoolArray]:
    """The pushes of each number of windows, as masks."""
    return [repertoire.pushes.windows == count for count in np.unique(repertoire.pushes.windows)]


def _noise(repertoire: Repertoire, variance: Array) -> Array:
    """Standard deviations (n,) over those of an average push, of variances (n, 3)."""
    average = np.einsum("nii->i", repertoire.covariance) / len(repertoire)
    return np.asarray(np.sqrt((variance / np.maximum(average, FLOOR)).mean(axis=-1)))


def _chosen(costs: Array, noise: Array, parents: IntArray, count: int) -> IntArray:
    """Indices of up to `count` of n options: for each weight of the noise an equal share, the cheapest of each parent.

    Parents take turns.
    """
    chosen: list[int] = []
    for share, weight in enumerate(WEIGHTS, 1):
        order = np.argsort(costs + weight * noise, kind="stable")
        order = order[np.argsort(_ranks(parents[order]), kind="stable")]
        new = order[~np.isin(order, chosen)]
        chosen += new[: count * share // len(WEIGHTS) - len(chosen)].tolist()
    return np.array(chosen, dtype=np.int64)


def _ranks(groups: IntArray) -> IntArray:
    """How many earlier entries (n,) have the same group."""
    order = np.argsort(groups, kind="stable")
    ranks = np.empty(len(groups), dtype=np.int64)
    ranks[order] = np.arange(len(groups)) - np.searchsorted(groups[order], groups[order])
    return ranks


def _check(scene: Scene, slider: Array, risk: float, margin: float, most_pushes: int) -> None:
    if slider.shape != (3,) or not np.all(np.isfinite(slider)):
        raise RequestError("slider", slider.tolist(), "three finite numbers x, y in m, heading in rad")
    if not 0.0 < risk < 1.0:
        raise RequestError("risk", risk, "a number between 0 and 1")
    if not 0.0 <= margin < np.inf:
        raise RequestError("margin", margin, "a finite number from 0, in m")
    if most_pushes < 1:
        raise RequestError("most_pushes", most_pushes, "1 or more")
    if not scene.clearance(slider) > 0.0:
        raise RequestError("slider", slider.tolist(), "a pose on the table that touches no obstacle")
