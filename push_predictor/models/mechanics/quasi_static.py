"""Motion of a slider while a disc sweeps along a straight line: the limit surface integrated over the travel.

It depends on the path, not on the speed: the travel of the pusher (m) takes the place of time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, to_body
from push_predictor.geometry.outline import Outline
from push_predictor.models.mechanics.limit_surface import Support, body_twist
from push_predictor.types import Array, IntArray

LONGEST_STEP = 0.004  # m: about the radius of a pusher, so that no corner is stepped over
RELATIVE_TOLERANCE = 1e-4  # of a step's own motion
ABSOLUTE_TOLERANCE = 1e-6  # of the whole travel
TOUCHING = 2e-5  # m: a wider gap at the start of a step is no contact


@dataclass(frozen=True, eq=False)
class DiscContact:
    """A slider with its support, and a disc of pusher_radius (m) that touches it with Coulomb friction."""

    outline: Outline
    pusher_radius: float
    friction: float
    support: Support


@dataclass(frozen=True, eq=False)
class Sweep:
    """Straight paths of the disc's centre in the frame of the slider's first pose.

    start (n, 2) in m, direction (n, 2) of length 1, travel (n,) in m.
    """

    start: Array
    direction: Array
    travel: Array

    def rows(self, chosen: IntArray) -> Sweep:
        """The paths with the indices chosen (k,)."""
        return Sweep(self.start[chosen], self.direction[chosen], self.travel[chosen])

    def centre(self, done: Array) -> Array:
        """Centres (n, 2) after `done` (n,) metres of travel."""
        return self.start + done[:, None] * self.direction


def slide(contact: DiscContact, sweep: Sweep) -> Array:
    """Pose (n, 3: x, y in m, heading in rad) of the body after the sweep, from the pose (0, 0, 0).

    Each step is compared with two of half its length, which are accepted where they agree; otherwise that row's
    step is halved. So halving all steps changes a displacement by less than 1e-3 of itself. Smooth contacts take the
    longest step; a start or an end of slip, a corner and a loss of contact are located by halving.
    """
    pose, done = np.zeros((len(sweep.travel), 3)), np.zeros(len(sweep.travel))
    length = np.minimum(sweep.travel, LONGEST_STEP)
    rows = np.flatnonzero(sweep.travel > 0.0)
    while rows.size:
        paths, before, at = sweep.rows(rows), pose[rows], done[rows]
        step = np.minimum(np.minimum(length[rows], paths.travel - at), _free_travel(contact, paths, before, at))
        coarse = advance(contact, paths, before, at, step)
        middle = advance(contact, paths, before, at, step / 2.0)
        fine = advance(contact, paths, middle, at + step / 2.0, step / 2.0)
        allowed = RELATIVE_TOLERANCE * _size(fine - before, contact) + ABSOLUTE_TOLERANCE * paths.travel
        agree = _size(fine - coarse, contact) <= allowed
        pose[rows] = np.where(agree[:, None], fine, before)
        done[rows] = np.where(agree, at + step, at)
        length[rows] = np.where(agree, np.minimum(2.0 * step, LONGEST_STEP), step / 2.0)
        rows = rows[paths.travel - done[rows] > 1e-12 * paths.travel]
    return pose


def advance(contact: DiscContact, sweep: Sweep, pose: Array, done: Array, step: Array) -> Array:
    """Poses (n, 3) after one step (n,) in m of the classical fourth-order Runge-Kutta method.

    done (n,): metres of the sweep before the step.

    The rate is continuous but bent where slip starts or ends and where the pusher comes upon a corner; a step
    across such a place is of second order.
    """
    half, length = done + step / 2.0, step[:, None]
    k1, gap = _rate(contact, pose, sweep.centre(done), sweep.direction)
    k2, _ = _rate(contact, pose + 0.5 * length * k1, sweep.centre(half), sweep.direction)
    k3, _ = _rate(contact, pose + 0.5 * length * k2, sweep.centre(half), sweep.direction)
    k4, _ = _rate(contact, pose + length * k3, sweep.centre(done + step), sweep.direction)
    motion = length / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return pose + np.where((gap < TOUCHING)[:, None], motion, 0.0)


def _free_travel(contact: DiscContact, sweep: Sweep, pose: Array, done: Array) -> Array:
    """Travel (n,) in m within which an approaching disc cannot touch; infinite for one in contact or receding."""
    nearest = contact.outline.project(to_body(sweep.centre(done), pose))
    gap = nearest.distance - contact.pusher_radius
    nearing = np.einsum("nj,nj->n", rotate(sweep.direction, -pose[:, 2]), nearest.normal) < 0.0
    return np.where(nearing & (gap >= TOUCHING), gap, np.inf)


def _rate(contact: DiscContact, pose: Array, centre: Array, direction: Array) -> tuple[Array, Array]:
    """Change of the pose (n, 3) per metre of travel, as if in contact, and the gap to the disc (n,) in m."""
    nearest = contact.outline.project(to_body(centre, pose))
    heading = pose[:, 2]
    velocity = rotate(direction, -heading)
    twist, _ = body_twist(nearest.point, -nearest.normal, velocity, contact.support, contact.friction)
    rate = np.concatenate([rotate(twist[:, :2], heading), twist[:, 2:]], axis=1)
    return rate, nearest.distance - contact.pusher_radius


def _size(displacement: Array, contact: DiscContact) -> Array:
    """Sizes (n,) of displacements (n, 3) in m: a turn counts as its arc at the limit surface's length c."""
    return np.asarray(np.linalg.norm(displacement * [1.0, 1.0, contact.support.length], axis=1))
