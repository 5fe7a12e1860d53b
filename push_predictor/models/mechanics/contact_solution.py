"""The twist of a slider under a pusher that touches it: sticking or sliding, on any limit surface."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from push_predictor.types import Array, IntArray

ROOT_STEPS = 40
ROOT_TOLERANCE = 1e-5  # rad
BISECT_EVERY = 6  # steps: next to a flat or an edge of the limit surface, secants converge slowly

# From a load's force (x, y) and its moment over length, (n,) each, to a twist (vx, vy, w times length) up to a factor.
TwistOf: TypeAlias = Callable[[Array, Array, Array], tuple[Array, Array, Array]]


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
    right = _Edge(np.cos(right_edge), -np.sin(right_edge))
    left = _Edge(np.cos(left_edge), np.sin(left_edge))
    at_right, at_left = _under(twist_of, touch, right), _under(twist_of, touch, left)
    lags = np.maximum(at_right.lag(touch), 0.0), np.minimum(at_left.lag(touch), 0.0)
    slip = (at_left.lag(touch) > 0.0).astype(np.int64) - (at_right.lag(touch) < 0.0).astype(np.int64)
    sticks = (slip == 0) & (touch.along > 0.0)
    share, motion = np.where(slip > 0, 1.0, 0.0), _chosen(slip > 0, at_left, at_right)
    if sticks.any():
        root, inside = _root(twist_of, touch, (right, left), lags, sticks)
        share, motion = np.where(sticks, root, share), _chosen(sticks, inside, motion)
    moves = (touch.along > 0.0) & (motion.toward > 0.0)
    size = np.where(moves, touch.along / np.where(moves, motion.toward, 1.0), 0.0)
    push, rub = (a + share * (b - a) for a, b in zip(right, left, strict=True))
    return Driven(motion.vx * size, motion.vy * size, motion.spin * size, slip * moves, np.arctan2(rub, push))


class _Edge(NamedTuple):
    """Force along the normal and along its left, (n,) each."""

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


def _under(twist_of: TwistOf, touch: Touch, force: _Edge) -> _Motion:
    push, rub = force
    vx, vy, spin = twist_of(
        push * touch.normal_x - rub * touch.normal_y,
        push * touch.normal_y + rub * touch.normal_x,
        push * touch.normal_arm + rub * touch.left_arm,
    )
    toward = vx * touch.normal_x + vy * touch.normal_y + spin * touch.normal_arm
    return _Motion(vx, vy, spin, toward, vy * touch.normal_x - vx * touch.normal_y + spin * touch.left_arm)


def _chosen(first: np.ndarray, one: _Motion, other: _Motion) -> _Motion:
    return _Motion(*(np.where(first, a, b) for a, b in zip(one, other, strict=True)))


def _root(
    twist_of: TwistOf, touch: Touch, edges: tuple[_Edge, _Edge], lags: tuple[Array, Array], wanted: np.ndarray
) -> tuple[Array, _Motion]:
    """Shares (n,) between the cone's edges at which the contact moves with the pusher, and the motion there.

    The Illinois method. On an ellipsoid the velocity is linear in the force, and the first step is exact. A solved
    contact stays as it is, so that its motion does not depend on the others.
    """
    (low, high), (f_low, f_high) = (np.zeros(len(wanted)), np.ones(len(wanted))), lags
    right, left = edges
    middle, unsolved = np.full(len(wanted), 0.5), wanted
    side, change = np.zeros(len(wanted)), (left.push - right.push, left.rub - right.rub)
    for step in range(1, ROOT_STEPS + 1):
        gap = f_low - f_high
        share = np.where(f_low * f_high < 0.0, f_low / np.where(gap > 0.0, gap, 1.0), 0.5)
        between = low + (high - low) * (0.5 if step % BISECT_EVERY == 0 else share)
        middle = np.where(unsolved, between, middle)
        motion = _under(twist_of, touch, _Edge(right.push + middle * change[0], right.rub + middle * change[1]))
        lag = motion.lag(touch)
        unsolved = unsolved & (np.abs(lag) > ROOT_TOLERANCE * motion.toward) & (high - low > ROOT_TOLERANCE)
        if not unsolved.any():
            break
        up, down = unsolved & (lag > 0.0), unsolved & (lag <= 0.0)  # up: the force must turn further to the left
        f_high = np.where(up & (side > 0.0), 0.5 * f_high, np.where(down, lag, f_high))
        f_low = np.where(down & (side < 0.0), 0.5 * f_low, np.where(up, lag, f_low))
        low, high = np.where(up, middle, low), np.where(down, middle, high)
        side = np.where(up, 1.0, np.where(down, -1.0, side))
    return middle, motion
