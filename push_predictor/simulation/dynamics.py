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
        """A^-1 b for b (n, 3)."""
        turn = (b[:, 2] - (self.e * b[:, 0] + self.f * b[:, 1]) / self.a) / (self.i - (self.e**2 + self.f**2) / self.a)
        return np.stack([(b[:, 0] - self.e * turn) / self.a, (b[:, 1] - self.f * turn) / self.a, turn], axis=1)


@dataclass(frozen=True, eq=False)
class _DirectedDrag:
    """A for friction that depends on direction: matrix (n, 3, 3)."""

    matrix: Array

    def solve(self, b: Array) -> Array:
        """A^-1 b for b (n, 3)."""
        return np.asarray(np.linalg.solve(self.matrix, b[:, :, None])[:, :, 0])


@dataclass(frozen=True, eq=False)
class _Contact:
    """Contact geometry of a step.

    normal, tangent (n, 3): rows of the Jacobian; gap (n,) m; drive_normal, drive_tangent (n,) m/s: the tip's velocity
    along them; outward (n, 2): the outward normal in the world; fraction (n,): contact as a fraction of the perimeter.
    """

    normal: Array
    tangent: Array
    gap: Array
    drive_normal: Array
    drive_tangent: Array
    outward: Array
    fraction: Array


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
    tip, wrench = path.position(np.zeros_like(dt)), np.zeros_like(start)
    rows = [(pose, tip, wrench)]
    for step in range(1, int(np.ceil(np.max(duration / dt))) + 1):
        ahead = path.position(step * dt)
        travelled = np.hypot(*(tip - path.start).T)
        speed, wrench = _advance(physics, pose, speed, tip, travelled, (ahead - tip) / dt[:, None], dt)
        pose, tip = pose + dt[:, None] * speed, ahead
        rows.append((pose, tip, wrench))
    time = dt[:, None] * np.arange(len(rows))
    return Motion(time, *(np.stack(column, axis=1) for column in zip(*rows, strict=True)))


def _advance(
    physics: Physics, pose: Array, velocity: Array, tip: Array, travelled: Array, drive: Array, dt: Array
) -> tuple[Array, Array]:
    """New velocities (n, 3) and the wrench on the tip (n, 3) after a step with the tip at velocity drive (n, 2)."""
    contact = _contact(physics, pose, tip, drive)
    arms = _arms(physics.support, pose[:, 2])
    points = pose[:, :1] + arms[0], pose[:, 1:2] + arms[1]
    acting = physics.acting(pose, velocity, contact.fraction, travelled, points)
    momentum = velocity * np.stack([physics.mass, physics.mass, physics.inertia], axis=1)
    if acting.pull is not None:
        momentum = momentum + dt[:, None] * acting.pull
    drag_of = _drag if acting.grain is None and acting.viscosity is None else _directed_drag
    new = velocity
    for _ in range(DRAG_ITERATIONS):
        drag = drag_of(physics, acting, arms, new, dt)
        new, push, rub = _with_contact(drag, momentum, contact, acting.friction, dt)
    across = np.stack([-contact.outward[:, 1], contact.outward[:, 0]], axis=1)
    force = (push[:, None] * contact.outward - rub[:, None] * across) / dt[:, None]
    return new, np.column_stack([force, physics.radius * rub / dt])


def _arms(support: Array, heading: Array) -> tuple[Array, Array]:
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    return cos * support[:, 0] - sin * support[:, 1], sin * support[:, 0] + cos * support[:, 1]


def _drag(physics: Physics, acting: ActingForces, arms: tuple[Array, Array], velocity: Array, dt: Array) -> _Drag:
    x, y = arms
    vx = velocity[:, :1] - velocity[:, 2:] * y
    vy = velocity[:, 1:2] + velocity[:, 2:] * x
    rate = acting.grip / np.sqrt(vx * vx + vy * vy + REST_SPEED**2)
    along_x, along_y = rate * x, rate * y
    turn = np.sum(along_x * x + along_y * y, axis=1)
    return _Drag(
        physics.mass + dt * np.sum(rate, axis=1),
        -dt * np.sum(along_y, axis=1),
        dt * np.sum(along_x, axis=1),
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
    inertia = np.stack([physics.mass, physics.mass, physics.inertia], axis=1)
    return _DirectedDrag(dt[:, None, None] * resistance + inertia[:, :, None] * np.eye(3))


def _inverse(grain: Array | None, n: int) -> tuple[Array, Array, Array]:
    """Elements xx, xy, yy (n,) of W^-1."""
    if grain is None:
        return np.ones(n), np.zeros(n), np.ones(n)
    a, b = grain.T
    determinant = 1.0 - a * a - b * b
    return (1.0 - a) / determinant, -b / determinant, (1.0 + a) / determinant


def _contact(physics: Physics, pose: Array, tip: Array, drive: Array) -> _Contact:
    nearest = physics.outline.project(to_body(tip, pose))
    outward, arm = rotate(nearest.normal, pose[:, 2]), rotate(nearest.point, pose[:, 2])
    nx, ny, x, y = outward[:, 0], outward[:, 1], arm[:, 0], arm[:, 1]
    return _Contact(
        normal=np.stack([nx, ny, x * ny - y * nx], axis=1),
        tangent=np.stack([-ny, nx, x * nx + y * ny], axis=1),
        gap=nearest.distance - physics.radius,
        drive_normal=drive[:, 0] * nx + drive[:, 1] * ny,
        drive_tangent=drive[:, 1] * nx - drive[:, 0] * ny,
        outward=outward,
        fraction=nearest.contact,
    )


def _with_contact(
    drag: _Drag | _DirectedDrag, momentum: Array, contact: _Contact, friction: Array, dt: Array
) -> tuple[Array, Array, Array]:
    """Velocities (n, 3) and the contact's impulses: push (n,) >= 0 along -normal and rub (n,) along the tangent.

    A sticking contact solves (Gnn + C) push - Gnt rub = r, Gtt rub - Gnt push = s, where G is the inverse inertia at
    the contact and C the compliance of the implicit spring-damper. A sliding contact has rub = +-friction push.
    """
    free, back_n, back_t = drag.solve(momentum), drag.solve(contact.normal), drag.solve(contact.tangent)
    gnn = np.sum(contact.normal * back_n, axis=1) + 1.0 / (dt * (STIFFNESS * dt + DAMPING))
    gnt = np.sum(contact.normal * back_t, axis=1)
    gtt = np.sum(contact.tangent * back_t, axis=1)
    spring = STIFFNESS / (STIFFNESS * dt + DAMPING)
    restore = -contact.gap * np.where(contact.gap > 0.0, 1.0 / dt, spring)
    r = restore - (contact.drive_normal - np.sum(contact.normal * free, axis=1))
    s = contact.drive_tangent - np.sum(contact.tangent * free, axis=1)
    push, rub = _impulses(gnn, gnt, gtt, r, s, friction)
    return free - push[:, None] * back_n + rub[:, None] * back_t, push, rub


def _impulses(gnn: Array, gnt: Array, gtt: Array, r: Array, s: Array, friction: Array) -> tuple[Array, Array]:
    determinant = gnn * gtt - gnt * gnt
    push = (r * gtt + gnt * s) / determinant
    rub = (gnn * s + gnt * r) / determinant
    sticks = (push >= 0.0) & (np.abs(rub) <= friction * push)
    ratio = np.sign(np.where(push > 0.0, rub, s)) * friction  # of rub to push when the contact slides
    slide = np.maximum(r / np.maximum(gnn - ratio * gnt, SMALLEST_RESPONSE), 0.0)
    return np.where(sticks, push, slide), np.where(sticks, rub, ratio * slide)
