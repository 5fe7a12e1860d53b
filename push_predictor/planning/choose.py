"""Which push next: to a goal with the fewest pushes at a given probability.

Seen from the slider, push a moves it by D_a ~ N(mean, covariance) (repertoire.py), and e is the displacement that is
left to the goal. One push reaches it with probability

    P_a(e) = Pr(|D_a - e| within the goal's tolerances),        R(e) = max_a P_a(e).

If the likeliest push has P_a(e) >= p it is chosen: that is one push at probability p, and of those that aim at the
middle the one that scatters least. Otherwise the push is chosen that leaves the fewest to be expected, with e' what it
leaves and d the distance in longest pushes:

    J(a) = 1 + E h(e'),     h(e') = 0 within the tolerances, else 1 + (1 - R(e')) (1 + d(e')).

That is: one more push if it succeeds, and if it does not, one to mend it and as many as the way is long. Far from the
goal R is 0 and J asks for the shortest way that is left, which scatter lengthens; near it J asks for a place from where
a predictable push leads home. A covariance of zero makes R 0 or 1, the expectations vanish, and the nearest mean wins.
(Bertsekas, Dynamic Programming and Optimal Control, ch. 6: one-step lookahead with an approximate cost to go.)
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

DRAWS_AHEAD, OUTCOMES = 32, 16  # of a second push, of what the first may leave; powers of two fill evenly
SHORTLIST = 64  # first pushes of two whose outcomes are looked at
NEIGHBOURS = 16  # second pushes of two: those whose means come nearest
LEAST = 1e-6  # m, rad; a way is measured by the longest push, even if no push moves or none turns
TIE = 1e-6  # what a distance of one tolerance counts against a probability


@dataclass(frozen=True, eq=False, repr=False)
class Choice:
    """The chosen push (one), the probability that it reaches the goal, the pushes to be expected, this one included
    (J; of a push that is as likely as wanted 1 / P, as if a miss cost one more of its kind), and where it should leave
    the slider: mean (3,) and covariance (3, 3) in the world.
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
            f"  reaches the goal with probability {self.probability:.2f}; {self.expected:.1f} pushes expected in all\n"
            f"  slider expected at x {x:.4f} m, y {y:.4f} m, heading {heading:.3f} rad"
        )


def choose_push(repertoire: Repertoire, slider: Array, goal: Goal, probability: float = 0.9) -> Choice | None:
    """The next push on a slider at (3: x, y m, heading rad); None where the goal is reached.

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
    outlook = _Outlook(repertoire, goal)
    reach = outlook.reach(np.arange(len(repertoire)), ahead, DRAWS)
    best = int(np.argmax(reach - TIE * outlook.tolerances(ahead - repertoire.mean)))
    if reach[best] >= probability:
        return _choice(repertoire, best, slider, float(reach[best]), 1.0 / float(reach[best]))
    rows = np.argsort(outlook.cost(goal.left(ahead, repertoire.mean)), kind="stable")[:SHORTLIST]
    left = goal.left(ahead, repertoire.outcomes[rows, :OUTCOMES])
    expected = 1.0 + outlook.cost(left).mean(axis=1)
    best = int(rows[np.argmin(expected)])
    return _choice(repertoire, best, slider, float(reach[best]), float(expected.min()))


@dataclass(frozen=True, eq=False)
class _Outlook:
    """What the pushes of a repertoire promise for a goal."""

    repertoire: Repertoire
    goal: Goal

    def reach(self, rows: IntArray, ahead: Array, draws: int) -> Array:
        """Probabilities (...) that pushes rows (...) leave nothing of ahead (..., 3)."""
        beside = self.repertoire.outcomes[rows, :draws] - ahead[..., None, :]
        return np.asarray(self.goal.reached(beside).mean(axis=-1))

    def cost(self, ahead: Array) -> Array:
        """Pushes to be expected (...) where ahead (..., 3) is left: h of the module."""
        count = min(NEIGHBOURS, len(self.repertoire))
        nearest = self._tree.query(ahead * self._scale, range(1, count + 1))[1]
        reach = self.reach(nearest, ahead[..., None, :], DRAWS_AHEAD).max(axis=-1)
        way = np.hypot(np.hypot(ahead[..., 0], ahead[..., 1]) / self._longest, np.abs(ahead[..., 2]) / self._widest)
        return np.where(self.goal.reached(ahead), 0.0, 1.0 + (1.0 - reach) * (1.0 + way))

    def tolerances(self, ahead: Array) -> Array:
        """How far (...) it is, in tolerances of the goal."""
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
        return max(LEAST, float(np.hypot(*self.repertoire.mean[:, :2].T).max()))

    @cached_property
    def _widest(self) -> float:
        return max(LEAST, float(np.abs(self.repertoire.mean[:, 2]).max()))


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
