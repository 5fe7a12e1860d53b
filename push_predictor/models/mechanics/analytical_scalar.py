"""The analytical model in plain numbers: for a single push it is thirty times as fast as arrays of one row.

The same mathematics as in limit_surface and quasi_static, step by step, so that a push gets the same answer alone as
among others, to rounding. Many pushes are computed as arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, inf, isfinite, sin, sqrt
from typing import TypeAlias

import numpy as np

from push_predictor.geometry.nearest import ContactAt, Nearest, contact_on, nearest_on
from push_predictor.models.mechanics.analytical import AnalyticalPush
from push_predictor.models.mechanics.quasi_static import ABSOLUTE_TOLERANCE, LONGEST_STEP, RELATIVE_TOLERANCE, TOUCHING
from push_predictor.types import Array

Pose: TypeAlias = tuple[float, float, float]
Rates: TypeAlias = tuple[float, float, float, float, bool]  # of x, y, heading per metre; the gap, m; is it closing?
Rate: TypeAlias = Callable[[float, float, float, float], Rates]  # at a pose (x, y, heading) and a distance travelled


FEW = 16  # as fast as an array of them


@dataclass(frozen=True, eq=False)
class ScalarAnalyticalPush(AnalyticalPush):
    """AnalyticalPush that computes few pushes in plain numbers. Made by `scalar_analytical`; `replace` keeps caches.

    nearest: the outline's nearest point. start: a contact's point and inward normal.
    """

    nearest: Nearest = field(kw_only=True)
    start: ContactAt = field(kw_only=True)

    def displacement(self, inputs: Array, duration: Array) -> Array:
        """See AnalyticalPush."""
        if not 0 < len(inputs) <= FEW:
            return super().displacement(inputs, duration)
        pushes = list(zip(*inputs.T.tolist(), duration.tolist(), strict=True))
        if not all(0.0 <= v < inf and isfinite(c) and isfinite(a) and 0.0 <= d < inf for v, c, a, d in pushes):
            return super().displacement(inputs, duration)  # raises the error
        return np.array([self._displaced(*push) for push in pushes])

    def _displaced(self, velocity: float, contact: float, angle: float, duration: float) -> Pose:
        x, y, nx, ny = self.start(contact)
        c, s = cos(angle), sin(angle)
        ahead_x, ahead_y = c * nx - s * ny, s * nx + c * ny
        tip = x - self.pusher_radius * nx, y - self.pusher_radius * ny
        rate = _rate(self, self.nearest, tip, (ahead_x, ahead_y))
        moved_x, moved_y, turned = _slide(rate, velocity * duration, self.support.length)
        return ahead_x * moved_x + ahead_y * moved_y, ahead_x * moved_y - ahead_y * moved_x, turned


def scalar_analytical(physics: AnalyticalPush) -> ScalarAnalyticalPush:
    """The same model, prepared for single pushes."""
    outline = physics.outline
    return ScalarAnalyticalPush(
        outline,
        physics.pusher_radius,
        physics.contact_friction,
        physics.support,
        nearest=nearest_on(outline),
        start=contact_on(outline),
    )


def _rate(physics: AnalyticalPush, nearest: Nearest, tip: tuple[float, float], ahead: tuple[float, float]) -> Rate:
    """Change of the slider's pose per metre of the tip's path; see quasi_static._rate and limit_surface.body_twist."""
    (tip_x, tip_y), (ahead_x, ahead_y), radius = tip, ahead, physics.pusher_radius
    (centre_x, centre_y), length = physics.support.centre, physics.support.length
    friction = physics.contact_friction

    def rate(x: float, y: float, heading: float, done: float) -> Rates:
        c, s = cos(heading), sin(heading)
        from_x, from_y = tip_x + done * ahead_x - x, tip_y + done * ahead_y - y
        at_x, at_y, nx, ny, distance = nearest(c * from_x + s * from_y, c * from_y - s * from_x)
        nx, ny = -nx, -ny
        vx, vy = c * ahead_x + s * ahead_y, c * ahead_y - s * ahead_x
        along, across = vx * nx + vy * ny, vy * nx - vx * ny
        arm_x, arm_y = (at_x - centre_x) / length, (at_y - centre_y) / length
        p, q = arm_x * ny - arm_y * nx, arm_x * nx + arm_y * ny
        normal, tangent = _force(p, q, along, across, friction)
        spin = (p * normal + q * tangent) / length
        vx, vy = nx * normal - ny * tangent + spin * centre_y, ny * normal + nx * tangent - spin * centre_x
        return c * vx - s * vy, s * vx + c * vy, spin, distance - radius, along > 0.0

    return rate


def _force(p: float, q: float, along: float, across: float, friction: float) -> tuple[float, float]:
    """Force along the inward normal and its left; see limit_surface.contact_force."""
    if along <= 0.0:
        return 0.0, 0.0
    pp, pq, qq = 1.0 + p * p, p * q, 1.0 + q * q
    left_n, right_n = pp + friction * pq, pp - friction * pq
    left = left_n > 0.0 and across * left_n > along * (pq + friction * qq)
    right = right_n > 0.0 and across * right_n < along * (pq - friction * qq)
    if left == right:
        determinant = pp * qq - pq * pq
        return (qq * along - pq * across) / determinant, (pp * across - pq * along) / determinant
    normal = along / (left_n if left else right_n)
    return normal, friction * normal if left else -friction * normal


def _slide(rate: Rate, travel: float, length: float) -> Pose:
    """Pose after the sweep, in steps that are compared with two of half their length; see quasi_static.slide."""
    pose, done, longest = (0.0, 0.0, 0.0), 0.0, min(travel, LONGEST_STEP)
    first = rate(0.0, 0.0, 0.0, 0.0)
    while travel - done > 1e-12 * travel:
        *_, gap, closing = first
        step = min(longest, travel - done, gap if closing and gap >= TOUCHING else inf)
        half = done + 0.5 * step
        coarse, middle = _advance(rate, pose, done, step, first), _advance(rate, pose, done, 0.5 * step, first)
        fine = _advance(rate, middle, half, 0.5 * step, rate(*middle, half))
        allowed = RELATIVE_TOLERANCE * _size(fine, pose, length) + ABSOLUTE_TOLERANCE * travel
        if _size(fine, coarse, length) <= allowed:
            pose, done, longest = fine, done + step, min(2.0 * step, LONGEST_STEP)
            first = rate(*pose, done)
        else:
            longest = 0.5 * step
    return pose


def _advance(rate: Rate, pose: Pose, done: float, step: float, first: Rates) -> Pose:
    """Pose after one step of the classical Runge-Kutta method; first: the rate where it begins."""
    x, y, heading = pose
    ax, ay, ah, gap, _ = first
    if gap >= TOUCHING:
        return pose
    h, middle = 0.5 * step, done + 0.5 * step
    bx, by, bh, _, _ = rate(x + h * ax, y + h * ay, heading + h * ah, middle)
    cx, cy, ch, _, _ = rate(x + h * bx, y + h * by, heading + h * bh, middle)
    dx, dy, dh, _, _ = rate(x + step * cx, y + step * cy, heading + step * ch, done + step)
    k = step / 6.0
    return (
        x + k * (ax + 2.0 * bx + 2.0 * cx + dx),
        y + k * (ay + 2.0 * by + 2.0 * cy + dy),
        heading + k * (ah + 2.0 * bh + 2.0 * ch + dh),
    )


def _size(one: Pose, other: Pose, length: float) -> float:
    """Size of a motion in m: a turn counts as its arc at the limit surface's length."""
    x, y, turn = one[0] - other[0], one[1] - other[1], (one[2] - other[2]) * length
    return sqrt(x * x + y * y + turn * turn)
