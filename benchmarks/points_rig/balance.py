# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Quasi-static balance of forces: the slider's twist under a pushing tip, for many pushes at once.

Velocities are per unit of the tip's speed, forces per unit of the slider's friction in pure translation. The two
unknowns are the slip of the slider along the tip and the slider's rate of turning. The two equations are: no moment
about the contact, and Coulomb's law at the tip. Both frictions are smoothed below one percent of the tip's speed.
"""

from dataclasses import dataclass, fields

import numpy as np

from benchmarks.support.plane import Array, BoolArray, IntArray, dot, quarter_turn

SMOOTHING = 0.01  # of the tip's speed: below it, friction falls linearly to zero
TOLERANCE = 1e-7  # of the residual, in units of the slider's friction
ACCEPTED = 1e-4
ITERATIONS = 30
OTHER_GUESSES = [(slip, turning) for slip in (0.0, -1.0, 1.0, -0.3, 0.3) for turning in (0.0, -0.7, 0.7)]
LEVER = 0.03  # m, makes moments comparable with forces


@dataclass(frozen=True)
class Contact:
    """What a step's balance depends on, one row a push; world axes; lengths in m."""

    arms: Array  # (P, N, 2), from the contact to the support points
    loads: Array  # (P, N), friction of each point
    resistance: Array  # (P, 3), xx, xy, yy of the matrix that weighs a point's velocity
    normal: Array  # (P, 2), into the slider
    drive: Array  # (P, 2), velocity the tip imposes on the touched point
    friction: Array  # (P,), coefficient between tip and slider
    pull: Array  # (P, 2), force from outside
    moment: Array  # (P,), moment about the contact from outside
    offset: Array  # (P,), distance along the tangent at which the contact force acts

    def rows(self, index: IntArray | BoolArray) -> "Contact":
        """The same for some pushes."""
        return Contact(*(getattr(self, field.name)[index] for field in fields(self)))


@dataclass(frozen=True)
class Motion:
    """The solved step: touched point's velocity (P, 2), turning rate (P,) per m, force of the tip (P, 2)."""

    contact_velocity: Array
    turning: Array
    force: Array
    unknowns: Array  # (P, 2), slip and turning: the next step's first guess
    converged: BoolArray  # (P,)


@dataclass(frozen=True)
class _Trial:
    residual: Array  # (P, 2)
    jacobian: Array  # (P, 2, 2)
    force: Array  # (P, 2)


def solve(contact: Contact, guess: Array) -> Motion:
    """Solve the balance from a first guess (P, 2); where Newton's method stalls, from others."""
    unknowns, force, size = _newton(contact, guess)
    for other in OTHER_GUESSES:
        failed = np.flatnonzero(size > ACCEPTED)
        if not len(failed):
            break
        again, again_force, again_size = _newton(contact.rows(failed), np.tile(other, (len(failed), 1)))
        better = again_size < size[failed]
        rows = failed[better]
        unknowns[rows], force[rows], size[rows] = again[better], again_force[better], again_size[better]
    velocity = contact.drive + unknowns[:, :1] * quarter_turn(contact.normal)
    return Motion(velocity, unknowns[:, 1] / LEVER, force, unknowns, size <= ACCEPTED)


def _newton(contact: Contact, guess: Array) -> tuple[Array, Array, Array]:
    """Newton's method with backtracking: unknowns (P, 2), contact force (P, 2), size of the residual (P,)."""
    trial = _evaluate(contact, guess)
    unknowns, force, sizes = guess.copy(), trial.force.copy(), np.linalg.norm(trial.residual, axis=1)
    active, part, size = np.arange(len(guess)), contact, sizes.copy()
    step, damping = _newton_step(trial), np.ones(len(guess))
    for _ in range(ITERATIONS):
        keep = size > TOLERANCE
        if not keep.any():
            break
        if not keep.all():
            active, step, damping, size, part = active[keep], step[keep], damping[keep], size[keep], part.rows(keep)
        attempt = unknowns[active] + damping[:, None] * step
        trial = _evaluate(part, attempt)
        attempt_size = np.linalg.norm(trial.residual, axis=1)
        better = attempt_size < size * (1 - 1e-4 * damping)
        rows = active[better]
        unknowns[rows], force[rows], sizes[rows] = attempt[better], trial.force[better], attempt_size[better]
        step = np.where(better[:, None], _newton_step(trial), step)
        size = np.where(better, attempt_size, size)
        damping = np.where(better, 1.0, 0.4 * damping)
    return unknowns, force, sizes


def _evaluate(contact: Contact, unknowns: Array) -> _Trial:
    """Residual of moment and tip friction at unknowns (P, 2), with its derivatives."""
    tangent = quarter_turn(contact.normal)
    x, y = contact.arms[..., 0] / LEVER, contact.arms[..., 1] / LEVER
    slip, turning = unknowns[:, 0], unknowns[:, 1]
    base = contact.drive + slip[:, None] * tangent
    forces, sums = _friction_sums(contact, base, turning, x, y)
    force = forces[:, :2] - contact.pull
    normal_force, tangential = dot(force, contact.normal), dot(force, tangent)
    pressing = np.maximum(normal_force, 0.0)  # a tip cannot pull: rules out false roots
    loaded = contact.friction * (normal_force > 0)
    moment = forces[:, 2] - contact.moment / LEVER + contact.offset / LEVER * normal_force
    soft = np.sqrt(slip**2 + SMOOTHING**2)
    share = slip / soft
    by_slip = np.stack([dot(sums[:, :2], tangent), dot(sums[:, 1:3], tangent)], axis=1)
    by_turning = sums[:, 3:5]
    jacobian = np.empty((len(slip), 2, 2))
    for column, slope in enumerate((by_slip, by_turning)):
        jacobian[:, 0, column] = dot(slope, tangent) + loaded * share * dot(slope, contact.normal)
    jacobian[:, 0, 0] += contact.friction * pressing * SMOOTHING**2 / soft**3
    jacobian[:, 1, 0] = dot(by_turning, tangent) + contact.offset / LEVER * dot(by_slip, contact.normal)
    jacobian[:, 1, 1] = sums[:, 5] + contact.offset / LEVER * dot(by_turning, contact.normal)
    residual = np.stack([tangential + contact.friction * pressing * share, moment], axis=1)
    return _Trial(residual, jacobian, force)


def _friction_sums(contact: Contact, base: Array, turning: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """Force and moment of the support friction (P, 3), and the six sums (P, 6) their derivatives need."""
    xx, xy, yy = (contact.resistance[:, k, None] for k in range(3))
    ux, uy = base[:, :1] - turning[:, None] * y, base[:, 1:] + turning[:, None] * x
    px, py = xx * ux + xy * uy, xy * ux + yy * uy
    inverse = 1.0 / np.sqrt(ux * px + uy * py + SMOOTHING**2)
    weight = contact.loads * inverse
    cube = weight * inverse**2
    gx, gy = weight * px, weight * py
    forces = np.stack([gx.sum(1), gy.sum(1), (x * gy - y * gx).sum(1)], axis=1)
    dxx, dxy, dyy = weight * xx - cube * px * px, weight * xy - cube * px * py, weight * yy - cube * py * py
    turned_x, turned_y = dxy * x - dxx * y, dyy * x - dxy * y
    parts = (dxx, dxy, dyy, turned_x, turned_y, x * turned_y - y * turned_x)
    return forces, np.stack([part.sum(1) for part in parts], axis=1)


def _newton_step(trial: _Trial) -> Array:
    """Newton's step (P, 2), limited in length."""
    j, r = trial.jacobian, trial.residual
    determinant = j[:, 0, 0] * j[:, 1, 1] - j[:, 0, 1] * j[:, 1, 0]
    determinant = np.where(np.abs(determinant) < 1e-12, 1e-12, determinant)
    slip = (j[:, 0, 1] * r[:, 1] - j[:, 1, 1] * r[:, 0]) / determinant
    turning = (j[:, 1, 0] * r[:, 0] - j[:, 0, 0] * r[:, 1]) / determinant
    step = np.stack([slip, turning], axis=1)
    length = np.linalg.norm(step, axis=1, keepdims=True)
    return np.asarray(step * np.minimum(1.0, 1.0 / np.maximum(length, 1e-12)))
