# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Newton-Euler dynamics of many pushed sliders in lockstep.

Planar rigid bodies on support points with Coulomb friction, each pushed by a position-controlled rod. Backward
Euler in the velocities keeps both stiff parts (friction near rest, contact) stable at any step. Friction enters as a
drag grip / speed, iterated to its fixed point. The contact is a spring and damper along the normal with Coulomb
friction across it, solved in closed form for stick, slide or no contact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, to_body
from push_predictor.geometry.outline import Projection
from push_predictor.simulation.physics import ActingForces, Physics
from push_predictor.simulation.pushes import PusherPath
from push_predictor.types import Array

TRAVEL_STEP = 4e-5  # m travelled by a tip in a step
LONGEST_STEP = 0.004  # s
DRAG_ITERATIONS = 2
REST_SPEED = 1e-4  # m/s; Coulomb friction is smoothed below it
STIFFNESS = 1e5  # N/m of rod and slider along the normal
DAMPING = 400.0  # N s/m; overdamped for a kilogram, so that the contact does not bounce
SMALLEST_RESPONSE = 1e-9  # 1/kg; keeps a jammed slide finite


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of n pushes in t steps.

    time (n, t) s; slider (n, t, 3) x, y, heading; pusher (n, t, 2); wrench (n, t, 3) of the slider on the pusher:
    force in world axes, torque about the tip.
    """

    time: Array
    slider: Array
    pusher: Array
    wrench: Array


@dataclass(frozen=True, eq=False)
class _Drag:
    """A = M + dt D of the velocity update: [[a, 0, e], [0, a, f], [e, f, i]], each (n,)."""

    a: Array
    e: Array
    f: Array
    i: Array

    def solve(self, b: Array) -> Array:
        """A^-1 b for b (..., n, 3)."""
        x, y, solution = b[..., 0], b[..., 1], np.empty_like(b)
        turn = (b[..., 2] - (self.e * x + self.f * y) / self.a) / (self.i - (self.e**2 + self.f**2) / self.a)
        solution[..., 0], solution[..., 1] = (x - self.e * turn) / self.a, (y - self.f * turn) / self.a
        solution[..., 2] = turn
        return solution


@dataclass(frozen=True, eq=False)
class _DirectedDrag:
    """A for friction that depends on direction: matrix (n, 3, 3)."""

    matrix: Array

    def solve(self, b: Array) -> Array:
        """A^-1 b for b (..., n, 3)."""
        return np.asarray(np.linalg.solve(self.matrix, b[..., None])[..., 0])


@dataclass(frozen=True, eq=False)
class _Contact:
    """Contact geometry of a step.

    rows (2, n, 3): normal and tangent of the Jacobian; restore (n,) m/s: the speed with which spring and damper close
    the gap, compliance (n,) 1/kg; drive_normal, drive_tangent (n,) m/s: the tip's velocity along the rows; outward
    (n, 2): the outward normal in the world; nearest: the tips on the outline.
    """

    rows: Array
    restore: Array
    compliance: Array
    drive_normal: Array
    drive_tangent: Array
    outward: Array
    nearest: Projection


def steps_of(path: PusherPath) -> Array:
    """Time steps (n,) in s of pushes: the tip travels the same distance per step at every speed."""
    return np.minimum(LONGEST_STEP, TRAVEL_STEP / path.speed)


def run(
    physics: Physics,
    path: PusherPath,
    start: Array,
    duration: Array,
    *,
    velocity: Array | None = None,
    time_step: Array | None = None,
) -> Motion:
    """Simulate sliders from start (n, 3), with the tips on their paths, for at least duration (n,) s.

    velocity (n, 3): of the sliders at the start, zero by default. time_step (n,) s: steps_of(path) by default; the
    pushes have different time steps and the same number of them.
    """
    dt = steps_of(path) if time_step is None else time_step
    pose, speed = start.copy(), np.zeros_like(start) if velocity is None else velocity.copy()
    steps = np.arange(int(np.ceil(np.max(duration / dt))) + 1)
    tip = path.position(steps[:, None] * dt)
    travelled, drive = np.hypot(*np.moveaxis(tip - path.start, -1, 0)), np.diff(tip, axis=0) / dt[:, None]
    poses, wrenches = [pose], [np.zeros_like(start)]
    for here, far, ahead in zip(tip, travelled, drive, strict=False):  # the last tip has no step ahead
        speed, wrench = _advance(physics, pose, speed, here, far, ahead, dt)
        pose = pose + dt[:, None] * speed
        poses.append(pose)
        wrenches.append(wrench)
    motion = np.stack(poses, axis=1), np.ascontiguousarray(tip.swapaxes(0, 1)), np.stack(wrenches, axis=1)
    return Motion(dt[:, None] * steps, *motion)


def _advance(
    physics: Physics, pose: Array, velocity: Array, tip: Array, travelled: Array, drive: Array, dt: Array
) -> tuple[Array, Array]:
    """New velocities (n, 3) and the wrench on the tip (n, 3) after a step with the tip at velocity drive (n, 2)."""
    contact = _contact(physics, pose, tip, drive, dt)
    arms = _arms(physics.support, pose[:, 2])
    points = pose[:, :1] + arms[0], pose[:, 1:2] + arms[1]
    acting = physics.acting(pose, velocity, contact.nearest, travelled, points)
    momentum = velocity * physics.inertias
    if acting.pull is not None:
        momentum = momentum + dt[:, None] * acting.pull
    drag_of = _drag if acting.grain is None and acting.viscosity is None else _directed_drag
    new, loads, wrench = velocity, np.empty((3, *momentum.shape)), np.empty_like(momentum)
    loads[0], loads[1:] = momentum, contact.rows
    for _ in range(DRAG_ITERATIONS):
        drag = drag_of(physics, acting, arms, new, dt)
        new, push, rub = _with_contact(drag.solve(loads), contact, acting.friction)
    x, y = contact.outward.T
    wrench[:, 0], wrench[:, 1], wrench[:, 2] = push * x + rub * y, push * y - rub * x, physics.radius * rub
    return new, wrench / dt[:, None]


def _arms(support: Array, heading: Array) -> tuple[Array, Array]:
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    return cos * support[:, 0] - sin * support[:, 1], sin * support[:, 0] + cos * support[:, 1]


def _drag(physics: Physics, acting: ActingForces, arms: tuple[Array, Array], velocity: Array, dt: Array) -> _Drag:
    x, y = arms
    vx = velocity[:, :1] - velocity[:, 2:] * y
    vy = velocity[:, 1:2] + velocity[:, 2:] * x
    rate = acting.grip / np.sqrt(vx * vx + vy * vy + REST_SPEED**2)
    along_x, along_y = rate * x, rate * y
    turn = (along_x * x + along_y * y).sum(axis=1)
    return _Drag(
        physics.mass + dt * rate.sum(axis=1),
        -dt * along_y.sum(axis=1),
        dt * along_x.sum(axis=1),
        physics.inertia + dt * turn,
    )


def _directed_drag(
    physics: Physics, acting: ActingForces, arms: tuple[Array, Array], velocity: Array, dt: Array
) -> _DirectedDrag:
    """The drag with grain and viscosity: a point at velocity v resists with W^-1 v grip / sqrt(v' W^-1 v)."""
    x, y = arms
    vx = velocity[:, :1] - velocity[:, 2:] * y
    vy = velocity[:, 1:2] + velocity[:, 2:] * x
    xx, xy, yy = (element[:, None] for element in _inverse(acting.grain, len(x)))
    rate = acting.grip / np.sqrt(xx * vx * vx + 2.0 * xy * vx * vy + yy * vy * vy + REST_SPEED**2)
    share = np.zeros_like(rate) if acting.viscosity is None else acting.grip / acting.grip.sum(axis=1, keepdims=True)
    viscous = share if acting.viscosity is None else share * acting.viscosity[:, None]
    pxx, pxy, pyy = rate * xx + viscous, rate * xy, rate * yy + viscous
    ex, ey = pxy * x - pxx * y, pyy * x - pxy * y
    upper = [pxx, pxy, ex, pxy, pyy, ey, ex, ey, ey * x - ex * y]
    resistance = np.stack([np.sum(element, axis=1) for element in upper], axis=1).reshape(-1, 3, 3)
    return _DirectedDrag(dt[:, None, None] * resistance + physics.inertias[:, :, None] * np.eye(3))


def _inverse(grain: Array | None, n: int) -> tuple[Array, Array, Array]:
    """Elements xx, xy, yy (n,) of W^-1."""
    if grain is None:
        return np.ones(n), np.zeros(n), np.ones(n)
    a, b = grain.T
    determinant = 1.0 - a * a - b * b
    return (1.0 - a) / determinant, -b / determinant, (1.0 + a) / determinant


def _contact(physics: Physics, pose: Array, tip: Array, drive: Array, dt: Array) -> _Contact:
    nearest = physics.outline.project(to_body(tip, pose))
    outward, arm = rotate(nearest.normal, pose[:, 2]), rotate(nearest.point, pose[:, 2])
    (nx, ny), (x, y) = outward.T, arm.T
    gap, stiff, rows = nearest.distance - physics.radius, STIFFNESS * dt + DAMPING, np.empty((2, *pose.shape))
    rows[0, :, 0], rows[0, :, 1], rows[0, :, 2] = nx, ny, x * ny - y * nx  # np.stack takes several times as long
    rows[1, :, 0], rows[1, :, 1], rows[1, :, 2] = -ny, nx, x * nx + y * ny
    return _Contact(
        rows=rows,
        restore=-gap * np.where(gap > 0.0, 1.0 / dt, STIFFNESS / stiff),
        compliance=1.0 / (dt * stiff),
        drive_normal=drive[:, 0] * nx + drive[:, 1] * ny,
        drive_tangent=drive[:, 1] * nx - drive[:, 0] * ny,
        outward=outward,
        nearest=nearest,
    )


def _with_contact(solved: Array, contact: _Contact, friction: Array) -> tuple[Array, Array, Array]:
    """Velocities (n, 3) and the contact's impulses: push (n,) >= 0 along -normal and rub (n,) along the tangent.

    solved (3, n, 3): A^-1 of momentum, normal and tangent.
    A sticking contact solves (Gnn + C) push - Gnt rub = r, Gtt rub - Gnt push = s, where G is the inverse inertia at
    the contact and C the compliance of the implicit spring-damper. A sliding contact has rub = +-friction push.
    """
    free, back_n, back_t = solved
    (normal_speed, gnn, gnt), (tangent_speed, _, gtt) = (contact.rows[:, None] * solved).sum(axis=-1)
    r = contact.restore - (contact.drive_normal - normal_speed)
    s = contact.drive_tangent - tangent_speed
    push, rub = _impulses(gnn + contact.compliance, gnt, gtt, r, s, friction)
    return free - push[:, None] * back_n + rub[:, None] * back_t, push, rub


def _impulses(gnn: Array, gnt: Array, gtt: Array, r: Array, s: Array, friction: Array) -> tuple[Array, Array]:
    determinant = gnn * gtt - gnt * gnt
    push = (r * gtt + gnt * s) / determinant
    rub = (gnn * s + gnt * r) / determinant
    sticks = (push >= 0.0) & (np.abs(rub) <= friction * push)
    ratio = np.sign(np.where(push > 0.0, rub, s)) * friction  # of rub to push when the contact slides
    slide = np.maximum(r / np.maximum(gnn - ratio * gnt, SMALLEST_RESPONSE), 0.0)
    return np.where(sticks, push, slide), np.where(sticks, rub, ratio * slide)
