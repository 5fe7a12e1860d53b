# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The twist of a slider under a pusher that touches it: sticking or sliding, on any limit surface."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias, TypeVar

import numpy as np

from push_predictor.models.mechanics.limit_surface import contact_force
from push_predictor.types import Array, IntArray

ROOT_STEPS = 40
ROOT_TOLERANCE = 1e-10  # rad: a push alone and among others then agree to 1e-11 m; secants need one step more
RESTS = 2.0  # in place of the slip of a slider that the pusher leaves
KIND_OF_SLIP, KIND_OF_NORMAL = 100.0, 2.7  # weights that give different numbers to different kinds of contact
EVERY = slice(None)
BISECT_EVERY = 6  # steps: next to a flat or an edge of the limit surface, secants converge slowly

Numbers = TypeVar("Numbers", float, Array)
Rows: TypeAlias = "IntArray | slice"
# From some of the contacts (k,) and their load's force (x, y) and moment over length, (k,) or (2, k) each, to a twist
# (vx, vy, w times length) up to a factor.
TwistOf: TypeAlias = Callable[[Rows, Array, Array, Array], tuple[Array, Array, Array]]


class Touch(NamedTuple):
    """Contacts of n sliders, each (n,), in the body frame.

    normal_x, normal_y: inward normal. normal_arm, left_arm: moments about the centre of friction, over length, of unit
    forces along the normal and along its left. along, across: velocity of the pusher along the normal and its left.
    """

    normal_x: Array
    normal_y: Array
    normal_arm: Array
    left_arm: Array
    along: Array
    across: Array


def kind_of(slip: Numbers, normal_x: Numbers, normal_y: Numbers) -> Numbers:
    """A number for contacts with straight edges that slip alike; normal: of the edge."""
    return KIND_OF_SLIP * slip + normal_x + KIND_OF_NORMAL * normal_y


class Driven(NamedTuple):
    """Motion of n sliders, each (n,): velocity of the centre of friction, spin (w times length), slip, force.

    Slip is +1 where the pusher slips to the left of the inward normal, -1 to the right, 0 where it sticks. force_angle:
    of the contact force, rad from the normal.
    """

    vx: Array
    vy: Array
    spin: Array
    slip: IntArray
    force_angle: Array


def driven(twist_of: TwistOf, touch: Touch, left_edge: Array, right_edge: Array) -> Driven:
    """Motion of sliders under a pusher with a friction cone from -right_edge to left_edge (n,) rad about the normal.

    A pusher that does not approach leaves the slider at rest. The limit surface is convex, so the direction of the
    contact's velocity turns with that of the force: at the edges of the cone it shows whether the contact slips, and
    between them lies the force of a contact that sticks.
    """
    angles = np.stack([-right_edge, left_edge])  # both edges at once: few contacts take as long as one
    edges = _Edge(np.cos(angles), np.sin(angles))
    at_edges = _under(twist_of, EVERY, touch, edges)
    lag_right, lag_left = at_edges.lag(touch)
    slip = (lag_left > 0.0).astype(np.int64) - (lag_right < 0.0).astype(np.int64)
    share = np.where(slip > 0, 1.0, 0.0)
    motion = _Motion(*(np.where(slip > 0, left, right) for right, left in at_edges))
    sticks = np.flatnonzero((slip == 0) & (touch.along > 0.0))
    if sticks.size:
        bracket = _Bracket.of(np.maximum(lag_right, 0.0)[sticks], np.minimum(lag_left, 0.0)[sticks])
        _stick(twist_of, sticks, touch, edges, bracket, share, motion)
    moves = (touch.along > 0.0) & (motion.toward > 0.0)
    size = np.where(moves, touch.along / np.where(moves, motion.toward, 1.0), 0.0)
    push, rub = (right + share * (left - right) for right, left in edges)
    return Driven(motion.vx * size, motion.vy * size, motion.spin * size, slip * moves, np.arctan2(rub, push))


def driven_on_ellipsoid(touch: Touch, friction: Array) -> Driven:
    """Motion of sliders on an ellipsoid, in closed form, with the same friction (n,) of slip to both sides."""
    p, q = touch.normal_arm, touch.left_arm
    push, rub, slip = contact_force(1.0 + p * p, p * q, 1.0 + q * q, touch.along, touch.across, friction)
    vx, vy = push * touch.normal_x - rub * touch.normal_y, push * touch.normal_y + rub * touch.normal_x
    return Driven(vx, vy, push * p + rub * q, slip, np.arctan2(rub, push))


class _Edge(NamedTuple):
    """Force along the normal and along its left, (n,) each, or (2, n) at the right and the left edge of the cone."""

    push: Array
    rub: Array


class _Motion(NamedTuple):
    """A twist and the velocity of the body at the contact: toward (along the normal) and sideways (along its left)."""

    vx: Array
    vy: Array
    spin: Array
    toward: Array
    sideways: Array

    def lag(self, touch: Touch) -> Array:
        """Above 0 where the force must turn to the left, for the contact to move as the pusher does.

        The cross product of the contact's velocity with the pusher's. The velocity is within a right angle of the
        force, so one away from the pusher lies beyond the normal's left or right, whatever the pusher's is.
        """
        return np.maximum(self.toward, 0.0) * touch.across - self.sideways * touch.along


def _under(twist_of: TwistOf, rows: Rows, touch: Touch, force: _Edge) -> _Motion:
    push, rub = force
    vx, vy, spin = twist_of(
        rows,
        push * touch.normal_x - rub * touch.normal_y,
        push * touch.normal_y + rub * touch.normal_x,
        push * touch.normal_arm + rub * touch.left_arm,
    )
    toward = vx * touch.normal_x + vy * touch.normal_y + spin * touch.normal_arm
    return _Motion(vx, vy, spin, toward, vy * touch.normal_x - vx * touch.normal_y + spin * touch.left_arm)


class _Bracket(NamedTuple):
    """Shares between the cone's edges about that of sticking, their lags, and the side that moved last, (k,) each."""

    low: Array
    high: Array
    lag_low: Array
    lag_high: Array
    side: Array

    @staticmethod
    def of(lag_low: Array, lag_high: Array) -> _Bracket:
        """The whole cone."""
        k = len(lag_low)
        return _Bracket(np.zeros(k), np.ones(k), lag_low, lag_high, np.zeros(k))

    def inside(self, halve: bool) -> Array:
        """The next shares to try: those of a straight line between the ends, or the middle."""
        gap = self.lag_low - self.lag_high
        line = np.where(self.lag_low * self.lag_high < 0.0, self.lag_low / np.where(gap > 0.0, gap, 1.0), 0.5)
        return np.asarray(self.low + (self.high - self.low) * (0.5 if halve else line))

    def narrowed(self, share: Array, lag: Array) -> _Bracket:
        """With one end moved to `share`; the other end's lag is halved if it stays a second time (Illinois)."""
        up = lag > 0.0  # the force must turn further to the left
        return _Bracket(
            np.where(up, share, self.low),
            np.where(up, self.high, share),
            np.where(up, lag, np.where(self.side < 0.0, 0.5 * self.lag_low, self.lag_low)),
            np.where(up, np.where(self.side > 0.0, 0.5 * self.lag_high, self.lag_high), lag),
            np.where(up, 1.0, -1.0),
        )


def _stick(
    twist_of: TwistOf,
    rows: IntArray,
    touch: Touch,
    edges: _Edge,
    bracket: _Bracket,
    share: Array,
    motion: _Motion,
) -> None:
    """Write into `share` and `motion`, for the rows (k,), the force at which the contact moves with the pusher.

    On an ellipsoid the velocity is linear in the force, and the first step is exact. A solved contact stays as it is,
    so that its motion does not depend on the others.
    """
    start, change = _Edge(edges.push[0], edges.rub[0]), _Edge(*(left - right for right, left in edges))
    for step in range(1, ROOT_STEPS + 1):
        tried, at = bracket.inside(halve=step % BISECT_EVERY == 0), Touch(*(part[rows] for part in touch))
        force = _Edge(*(a[rows] + tried * b[rows] for a, b in zip(start, change, strict=True)))
        found = _under(twist_of, rows, at, force)
        share[rows] = tried
        for part, new in zip(motion, found, strict=True):
            part[rows] = new
        lag = found.lag(at)
        open_ = (np.abs(lag) > ROOT_TOLERANCE * found.toward) & (bracket.high - bracket.low > ROOT_TOLERANCE)
        if not open_.any():
            break
        bracket = bracket.narrowed(tried, lag)
        rows, bracket = rows[open_], _Bracket(*(part[open_] for part in bracket))
