# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Choose the next push: reach a goal with the fewest pushes at a given probability.

In the slider's frame, push a moves the slider by D_a ~ N(mean, covariance) (repertoire.py), and e is the remaining
displacement to the goal. One push reaches the goal with probability

    P_a(e) = Pr(|D_a - e| within the goal's tolerances),        R(e) = max_a P_a(e).

If the most probable push has P_a(e) >= p, it is chosen: one push suffices, and of the pushes that aim at the goal the
one with the least noise wins. Otherwise the push with the smallest expected number of pushes is chosen, with e' the
displacement that remains after it and d the distance in units of the longest push:

    J(a) = 1 + E h(e'),     h(e') = 0 within the tolerances, else 1 + (1 - R(e')) (1 + d(e')).

That is one more push if it succeeds; if it fails, one to correct it and as many as the distance requires. Far from the
goal R is 0, and J prefers the shortest remaining distance. Near the goal J prefers a pose from which a predictable push
reaches it. With zero covariance R is 0 or 1, the expectations vanish, and the nearest mean wins.
Source: Bertsekas, Dynamic Programming and Optimal Control, ch. 6: one-step lookahead with an approximate cost to go.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from push_predictor.errors import RequestError
from push_predictor.geometry.touch import covariance_in_world, displaced
from push_predictor.planning.goal import Goal
from push_predictor.planning.repertoire import DRAWS, Repertoire, StraightPushes
from push_predictor.types import Array, IntArray

DRAWS_AHEAD, OUTCOMES = 32, 16  # samples of a second push, of a first push; powers of two suit Sobol points
SHORTLIST = 64  # candidates for the first of two pushes
NEIGHBOURS = 16  # candidates for the second push: those with the nearest means
SMALLEST_PUSH = 1e-6  # m, rad; avoids division by zero if no push moves or turns the slider
TIE = 1e-6  # weight of the distance (in tolerances) against the probability, to break ties


@dataclass(frozen=True, eq=False, repr=False)
class Choice:
    """The chosen push (one), and the probability that it reaches the goal.

    expected: number of pushes to the goal, this one included. It is J of the module, or 1 / P for a push that is at
    least as probable as requested, as if each miss cost one more push of this kind. mean (3,), covariance (3, 3): pose
    of the slider after the push, in the world.
    """

    push: StraightPushes
    probability: float
    expected: float
    mean: Array
    covariance: Array

    def __repr__(self) -> str:
        (velocity, contact, angle), windows = self.push.inputs[0], int(self.push.windows[0])
        x, y, heading = self.mean
        return (
            f"Choice: contact {contact:.3f}, angle {angle:+.2f} rad, {1e3 * velocity:.1f} mm/s, for {windows} windows\n"
            f"  reaches the goal with probability {self.probability:.2f}; pushes expected: {self.expected:.1f}\n"
            f"  slider expected at x {x:.4f} m, y {y:.4f} m, heading {heading:.3f} rad"
        )


def choose_push(repertoire: Repertoire, slider: Array, goal: Goal, probability: float = 0.9) -> Choice | None:
    """Choose the next push for a slider at (3: x, y m, heading rad); None if the goal is reached.

    Raises RequestError for a probability outside (0, 1) and a slider whose pose is not finite.
    """
    slider = np.asarray(slider, dtype=np.float64)
    if slider.shape != (3,) or not np.all(np.isfinite(slider)):
        raise RequestError("slider", slider.tolist(), "three finite numbers x, y in m, heading in rad")
    if not 0.0 < probability < 1.0:
        raise RequestError("probability", probability, "a number between 0 and 1")
    ahead = goal.ahead(slider)
    if goal.reached(ahead):
        return None
    lookahead = _Lookahead(repertoire, goal)
    reach = lookahead.reach(np.arange(len(repertoire)), ahead, DRAWS)
    best = int(np.argmax(reach - TIE * lookahead.tolerances(ahead - repertoire.mean)))
    if reach[best] >= probability:
        return _choice(repertoire, best, slider, float(reach[best]), 1.0 / float(reach[best]))
    rows = np.argsort(lookahead.cost(goal.remaining(ahead, repertoire.mean)), kind="stable")[:SHORTLIST]
    remaining = goal.remaining(ahead, repertoire.outcomes[rows, :OUTCOMES])
    expected = 1.0 + lookahead.cost(remaining).mean(axis=1)
    best = int(rows[np.argmin(expected)])
    return _choice(repertoire, best, slider, float(reach[best]), float(expected.min()))


@dataclass(frozen=True, eq=False)
class _Lookahead:
    """Probabilities and costs of the pushes of a repertoire with respect to a goal."""

    repertoire: Repertoire
    goal: Goal

    def reach(self, rows: IntArray, ahead: Array, draws: int) -> Array:
        """Probabilities (...) that pushes rows (...) reach the goal at the displacements ahead (..., 3)."""
        error = self.repertoire.outcomes[rows, :draws] - ahead[..., None, :]
        return np.asarray(self.goal.reached(error).mean(axis=-1))

    def cost(self, ahead: Array) -> Array:
        """Expected number of pushes (...) for remaining displacements ahead (..., 3): h of the module."""
        count = min(NEIGHBOURS, len(self.repertoire))
        nearest = self._tree.query(ahead * self._scale, range(1, count + 1))[1]
        reach = self.reach(nearest, ahead[..., None, :], DRAWS_AHEAD).max(axis=-1)
        distance = np.hypot(
            np.hypot(ahead[..., 0], ahead[..., 1]) / self._longest, np.abs(ahead[..., 2]) / self._widest
        )
        return np.where(self.goal.reached(ahead), 0.0, 1.0 + (1.0 - reach) * (1.0 + distance))

    def tolerances(self, ahead: Array) -> Array:
        """Distance (...) in units of the goal's tolerances."""
        return np.asarray(np.linalg.norm(ahead * self._scale, axis=-1))

    @cached_property
    def _scale(self) -> Array:
        turn = 0.0 if self.goal.turn is None else 1.0 / self.goal.turn
        return np.array([1.0 / self.goal.distance, 1.0 / self.goal.distance, turn])

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.repertoire.mean * self._scale)

    @cached_property
    def _longest(self) -> float:
        return max(SMALLEST_PUSH, float(np.hypot(*self.repertoire.mean[:, :2].T).max()))

    @cached_property
    def _widest(self) -> float:
        return max(SMALLEST_PUSH, float(np.abs(self.repertoire.mean[:, 2]).max()))


def _choice(repertoire: Repertoire, row: int, slider: Array, probability: float, expected: float) -> Choice:
    mean, covariance = repertoire.mean[row : row + 1], repertoire.covariance[row : row + 1]
    heading = slider[2:]
    return Choice(
        repertoire.pushes.take(np.array([row])),
        probability,
        expected,
        displaced(slider[None], heading, mean)[0],
        covariance_in_world(covariance, heading)[0],
    )
