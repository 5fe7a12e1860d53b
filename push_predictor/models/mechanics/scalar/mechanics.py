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

"""Fitted mechanics in plain numbers: for a single push some twenty times as fast as arrays of one row.

The same mathematics as in forward, step by step, so that a push gets the same answer alone as among others, to the
tolerance of the contact. Many pushes, and pushes with inertia, are computed as arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import atan2, cos, isfinite, log, sin, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np

from push_predictor.geometry.nearest import ContactAt, Nearest, contact_on, nearest_on
from push_predictor.models.mechanics.fitted import NO_CHANGES, RECORDING, FittedMechanics
from push_predictor.models.mechanics.motion.contact_solution import kind_of
from push_predictor.models.mechanics.motion.fine_sweep import (
    AFTER,
    DIFFERENCE,
    OF_CORNER,
    OF_TRAVEL_FINELY,
    SHORTEST_AT_CORNER,
)
from push_predictor.models.mechanics.motion.friction_cone import REFERENCE_SPEED, SLOWEST
from push_predictor.models.mechanics.motion.sweep import FINE, LONGEST_STEP, OF_TRAVEL, SHORTEST_STEP, TOUCHING
from push_predictor.models.mechanics.parameters import RowValues
from push_predictor.models.mechanics.scalar.contact import (
    LastContact,
    ScalarTouch,
    driven_on_ellipsoid,
    driven_scalar,
)
from push_predictor.models.mechanics.scalar.surface import (
    ScalarSurface,
    Three,
    Twist,
    is_ellipsoid,
    loaded,
    root_of_stretch,
    scalar_surface,
)
from push_predictor.types import Array

MOST_SURFACES = 64  # that are kept prepared
FEW = 200  # pushes: as fast as an array of them
AT_REST = (0.0, 0.0, 0.0)
FRICTION_CHANGES = ("friction_by_angle", "friction_by_speed", "friction_by_load")  # along a push

# At a pose (x, y, heading) and a distance travelled: change of the pose per metre, the gap (m), the approach, and the
# kind of contact; see fine_sweep.KindRates.
Rates: TypeAlias = tuple[float, float, float, float, float, float]
Rate: TypeAlias = Callable[[float, float, float, float], Rates]


class WorldVectors(NamedTuple):
    """Vectors of the parameters that act in body or world: see parameters."""

    stretch: tuple[float, float]
    grain: tuple[float, float]
    slope: tuple[float, float]
    gradient: tuple[float, float]


@dataclass(frozen=True, eq=False)
class ScalarMechanics(FittedMechanics):
    """FittedMechanics that computes few pushes in plain numbers. Made by `scalar_mechanics`."""

    nearest: Nearest = field(kw_only=True)
    contact_at: ContactAt = field(kw_only=True)
    _surfaces: dict[object, ScalarSurface] = field(default_factory=dict, kw_only=True)

    def displacement(
        self,
        inputs: Array,
        duration: Array,
        covariates: Mapping[str, Array] | None = None,
        changes: Mapping[str, Array] = NO_CHANGES,
    ) -> Array:
        """See FittedMechanics."""
        if not changes:
            return self._displacement(inputs, duration, covariates)
        if len(inputs) > FEW:
            return super().displacement(inputs, duration, covariates, changes)
        return np.concatenate([self._changed(k, inputs, duration, covariates, changes) for k in range(len(inputs))])

    def _changed(
        self, k: int, inputs: Array, duration: Array, given: Mapping[str, Array] | None, changes: Mapping[str, Array]
    ) -> Array:
        """Displacement (1, 3) of push k."""
        values = {**self.values, **{name: self.value(name) + float(change[k]) for name, change in changes.items()}}
        covariates = {name: column[k : k + 1] for name, column in (given or {}).items()}
        return replace(self, values=values)._displacement(inputs[k : k + 1], duration[k : k + 1], covariates)

    def _displacement(self, inputs: Array, duration: Array, covariates: Mapping[str, Array] | None) -> Array:
        given = covariates or {}
        pushes = [(*row, seconds) for row, seconds in zip(inputs.tolist(), duration.tolist(), strict=True)]
        plain = 0 < len(pushes) <= FEW and all(isfinite(sum(push)) for push in pushes)
        if not plain or self.value("inertia") or any(name not in given for name in self.needs):
            return super().displacement(inputs, duration, covariates)
        heading = given["push_heading"].tolist() if "push_heading" in given else [0.0] * len(pushes)
        recording = given[RECORDING].tolist() if RECORDING in given else [-1] * len(pushes)
        moved = [
            self.moved(velocity, contact, angle, seconds, ahead, number)
            for (velocity, contact, angle, seconds), ahead, number in zip(pushes, heading, recording, strict=True)
        ]
        return np.array(moved)

    def moved(
        self,
        velocity: float,
        contact: float,
        angle: float,
        duration: float,
        heading: float = 0.0,
        recording: float = -1,
    ) -> Three:
        """Displacement of one push, without checks. heading: of the push in the world, where a parameter needs it."""
        return _Push(self, self._surface(recording), velocity, contact, angle, duration, heading).displacement()

    @cached_property
    def world(self) -> WorldVectors:
        """Vectors of the parameters that act in body or world."""
        value = self.values.get
        pairs = (
            ("body_anisotropy", "body_anisotropy_diagonal"),
            ("grain_x", "grain_diagonal"),
            ("slope_x", "slope_y"),
            ("gradient_x", "gradient_y"),
        )
        return WorldVectors(*((value(first, 0.0), value(second, 0.0)) for first, second in pairs))

    @cached_property
    def friction_changes(self) -> bool:
        """Whether the contact friction changes along a push."""
        return any(map(self.values.get, FRICTION_CHANGES))

    @cached_property
    def needs(self) -> tuple[str, ...]:
        """See FittedMechanics."""
        return super().needs

    def _surface(self, recording: float) -> ScalarSurface:
        key = recording, self.value("rim_exponent"), self.value("pressure_spread")
        if key not in self._surfaces:
            if len(self._surfaces) >= MOST_SURFACES:
                self._surfaces.clear()
            values = RowValues(self.values, 1, {RECORDING: np.array([recording])})
            self._surfaces[key] = scalar_surface(self.mechanics.surfaces(values))
        return self._surfaces[key]


def scalar_mechanics(fitted: FittedMechanics) -> ScalarMechanics:
    """The same mechanics, prepared for single pushes."""
    outline = fitted.mechanics.outline
    return ScalarMechanics(
        fitted.mechanics,
        fitted.values,
        fitted.covariance,
        nearest=nearest_on(outline),
        contact_at=contact_on(outline),
    )


class _Push:
    """One push: see recorded_push.TruePush and forward."""

    def __init__(
        self,
        model: ScalarMechanics,
        surface: ScalarSurface,
        velocity: float,
        contact: float,
        angle: float,
        duration: float,
        heading: float,
    ) -> None:
        value = model.values.get
        self.model, self.surface, self.last = model, surface, LastContact()
        x, y, nx, ny = model.contact_at(contact)
        rx, ry = _turned(nx, ny, angle)  # direction of the path, as it was recorded
        along = value("tip_offset_along", 0.0) + velocity * value("clock_delay", 0.0)
        across, rig_radius = value("tip_offset_across", 0.0), model.mechanics.pusher_radius
        x, y = x - rig_radius * nx + along * rx - across * ry, y - rig_radius * ny + along * ry + across * rx
        shift_x, shift_y, turned = value("outline_x", 0.0), value("outline_y", 0.0), value("tracker_rotation", 0.0)
        error = value("radius_error", 0.0)
        self.radius, self.tip = rig_radius + error, _turned(x - shift_x, y - shift_y, -turned)
        if along or across or shift_x or shift_y or turned or error:
            at_x, at_y, nx, ny, _ = model.nearest(*self.tip)
            self.tip = at_x + nx * self.radius, at_y + ny * self.radius
        self.recorded, self.origin = _turned(rx, ry, -turned), _turned(-shift_x, -shift_y, -turned)
        self.ahead = _turned(*self.recorded, value("push_rotation", 0.0))
        self.speed = velocity * (1.0 + value("travel_share", 0.0))
        self.travel = self.speed * duration
        self.heading = heading - atan2(self.recorded[1], self.recorded[0])
        self.friction, self.world = model.value("contact_friction"), model.world
        none = self.world.stretch == (0.0, 0.0)
        self.stretch = None if none else root_of_stretch(*self.world.stretch, surface.reach)  # without grain
        # What is the same all along the push is computed once; None if it is not.
        self.cone = None if model.friction_changes else self._edges(self.friction)
        self.centre = None if self.world.gradient != (0.0, 0.0) else self._own_centre()
        same = self.world.grain == self.world.slope == (0.0, 0.0)
        self.twist = self._loaded(0.0) if same else None
        self.ellipsoid = self.twist is not None and is_ellipsoid(self.twist)

    def displacement(self) -> Three:
        """Displacement in the recorded push frame."""
        accuracy = self.model.mechanics.accuracy
        sweep = _swept if accuracy > FINE else _swept_finely
        x, y, turn = sweep(self._rate(), self.travel, self.surface.length, accuracy)
        (ox, oy), (ahead_x, ahead_y) = self.origin, self.recorded
        turned_x, turned_y = _turned(ox, oy, turn)
        x, y = x + turned_x - ox, y + turned_y - oy
        return ahead_x * x + ahead_y * y, ahead_x * y - ahead_y * x, turn

    def _rate(self) -> Rate:
        """The rate of this push. Its variables are local: they are read some hundred times a push."""
        (tip_x, tip_y), (ahead_x, ahead_y), radius = self.tip, self.ahead, self.radius
        nearest, length, tolerance, last = self.model.nearest, self.surface.length, self.surface.tolerance, self.last
        same_centre, same_cone, same_twist, ellipsoid = self.centre, self.cone, self.twist, self.ellipsoid
        has_edges = self.model.mechanics.outline.semi_axes is None

        def rate(x: float, y: float, heading: float, done: float) -> Rates:
            c, s = cos(heading), sin(heading)
            from_x, from_y = tip_x + done * ahead_x - x, tip_y + done * ahead_y - y
            at_x, at_y, nx, ny, distance = nearest(c * from_x + s * from_y, c * from_y - s * from_x)
            nx, ny = -nx, -ny
            vx, vy = c * ahead_x + s * ahead_y, c * ahead_y - s * ahead_x
            centre_x, centre_y = same_centre or self._centre(heading)
            arm_x, arm_y = (at_x - centre_x) / length, (at_y - centre_y) / length
            along = vx * nx + vy * ny
            touch = nx, ny, arm_x * ny - arm_y * nx, arm_x * nx + arm_y * ny, along, vy * nx - vx * ny
            left, right = same_cone or self._friction(touch)
            if ellipsoid:
                vx, vy, spin, slip = driven_on_ellipsoid(touch, left, right)
            else:
                twist = same_twist or self._loaded(heading)
                vx, vy, spin, slip = driven_scalar(twist, touch, left, right, last, tolerance)
            spin /= length
            vx, vy = vx + spin * centre_y, vy - spin * centre_x
            kind = kind_of(slip, nx, ny) if has_edges else slip
            return c * vx - s * vy, s * vx + c * vy, spin, distance - radius, along, kind

        return rate

    def _own_centre(self) -> tuple[float, float]:
        x, y = self.surface.centre
        return x + self.model.values.get("centre_x", 0.0), y + self.model.values.get("centre_y", 0.0)

    def _centre(self, heading: float) -> tuple[float, float]:
        x, y = self._own_centre()
        gx, gy = _turned(*self.world.gradient, -(self.heading + heading))
        xx, xy, yy = self.surface.square
        return x + xx * gx + xy * gy, y + xy * gx + yy * gy

    def _friction(self, touch: ScalarTouch) -> tuple[float, float]:
        """Coefficients of slip to the left and to the right; see friction_cone."""
        value, friction = self.model.values.get, self.friction
        normal_x, normal_y, normal_arm, _, along, across = touch
        if by_angle := value("friction_by_angle", 0.0):
            friction += by_angle * abs(atan2(across, along))
        if by_speed := value("friction_by_speed", 0.0):
            friction += by_speed * log(max(self.speed * abs(across), SLOWEST) / REFERENCE_SPEED)
        if by_load := value("friction_by_load", 0.0):
            friction -= by_load * log(self.surface.gauge(normal_x, normal_y, normal_arm))
        return self._edges(friction)

    def _edges(self, friction: float) -> tuple[float, float]:
        difference = self.model.values.get("friction_difference", 0.0)
        return max(friction + difference, 0.0), max(friction - difference, 0.0)

    def _loaded(self, heading: float) -> Twist:
        """The surface under what acts at this heading; see forward and loaded_surface."""
        world, turn = self.world, self.heading + heading
        stretch, pull = self.stretch, None
        if world.grain != (0.0, 0.0):
            a, b = _turned(*world.grain, -2.0 * turn)
            stretch = root_of_stretch(world.stretch[0] + a, world.stretch[1] + b, self.surface.reach)
        if world.slope != (0.0, 0.0):
            pull = (*_turned(*world.slope, -turn), 0.0)
        return loaded(self.surface, stretch, pull, self.model.values.get("pushing_height", 0.0))


def _turned(x: float, y: float, angle: float) -> tuple[float, float]:
    if angle == 0.0:
        return x, y
    c, s = cos(angle), sin(angle)
    return c * x - s * y, s * x + c * y


def _swept(rate: Rate, travel: float, length: float, accuracy: float) -> Three:
    """Pose after the sweep; see sweep.swept."""
    x = y = heading = done = 0.0
    step, shortest = min(travel, LONGEST_STEP), SHORTEST_STEP * accuracy * LONGEST_STEP
    first = rate(x, y, heading, done) if travel > 0.0 else None
    while first is not None and travel - done > 1e-12 * travel:
        h, (ax, ay, aw, gap, nearing, _) = min(step, travel - done), first
        apart = gap >= TOUCHING
        if apart and nearing > 0.0:
            h = min(h, gap)
        k = 0.0 if apart else h
        bx, by, bw, *_ = rate(x + 0.5 * k * ax, y + 0.5 * k * ay, heading + 0.5 * k * aw, done + 0.5 * h)
        cx, cy, cw, *_ = rate(x + 0.75 * k * bx, y + 0.75 * k * by, heading + 0.75 * k * bw, done + 0.75 * h)
        part = k / 9.0
        mx, my = part * (2.0 * ax + 3.0 * bx + 4.0 * cx), part * (2.0 * ay + 3.0 * by + 4.0 * cy)
        mw = part * (2.0 * aw + 3.0 * bw + 4.0 * cw)
        last = rate(x + mx, y + my, heading + mw, done + h)
        part = k / 72.0
        ex = part * (-5.0 * ax + 6.0 * bx + 8.0 * cx - 9.0 * last[0])
        ey = part * (-5.0 * ay + 6.0 * by + 8.0 * cy - 9.0 * last[1])
        ew = part * (-5.0 * aw + 6.0 * bw + 8.0 * cw - 9.0 * last[2]) * length
        allowed = accuracy * (sqrt(mx * mx + my * my + (mw * length) ** 2) + OF_TRAVEL * travel)
        ratio = sqrt(ex * ex + ey * ey + ew * ew) / allowed
        if ratio <= 1.0 or h <= shortest:
            x, y, heading, done, first = x + mx, y + my, heading + mw, done + h, last
        factor = min(max(0.9 * max(ratio, 1e-3) ** (-1.0 / 3.0), 0.2), 4.0)
        step = min(max(h * factor, shortest), LONGEST_STEP)
    return x, y, heading


def _swept_finely(rate: Rate, travel: float, length: float, accuracy: float) -> Three:
    """Pose after the sweep; see fine_sweep.swept_finely."""
    pose, done, longest, rough = (0.0, 0.0, 0.0), 0.0, min(travel, LONGEST_STEP), False
    first = rate(*pose, done) if travel > 0.0 else None
    while first is not None and travel - done > 1e-12 * travel:
        step, gap = min(longest, travel - done), first[3]
        apart = gap >= TOUCHING
        if apart and first[4] > 0.0:
            step = min(step, gap)
        after, difference, one_kind = _advance(rate, pose, done, step, first)
        last = rate(*after, done + step)
        allowed = accuracy * (_distance(after, pose, length) + OF_TRAVEL_FINELY * travel)
        smooth = apart or (one_kind and last[5] == first[5])
        if rough or not (apart or (smooth and step * _size(difference, last, length) <= allowed)):
            fine = _in_halves(rate, pose, done, step, first)
            after_fine = rate(*fine, done + step)
            deeper = min(gap, 0.0) - after_fine[3] > OF_CORNER * allowed and step > SHORTEST_AT_CORNER
            if deeper or _distance(fine, after, length) > allowed:
                longest, rough = 0.5 * step, True
                continue
            after, last = fine, after_fine
        pose, done, longest, rough, first = after, done + step, min(2.0 * step, LONGEST_STEP), not smooth, last
    return pose


def _in_halves(rate: Rate, pose: Three, done: float, step: float, first: Rates) -> Three:
    """Pose after a step, in two halves."""
    half = done + 0.5 * step
    middle = _advance(rate, pose, done, 0.5 * step, first)[0]
    return _advance(rate, middle, half, 0.5 * step, rate(*middle, half))[0]


def _advance(rate: Rate, pose: Three, done: float, step: float, first: Rates) -> tuple[Three, Three, bool]:
    """Pose after one step by Kutta's 3/8 rule, and what the last rate is compared with; see fine_sweep. Whether all
    stages have contacts of one kind. first: the rates where it begins.
    """
    x, y, heading = pose
    ax, ay, ah, gap, _, kind = first
    if gap >= TOUCHING:
        return pose, AT_REST, True
    third = step / 3.0
    bx, by, bh, _, _, second = rate(x + third * ax, y + third * ay, heading + third * ah, done + third)
    at_x, at_y, at = x + step * bx - third * ax, y + step * by - third * ay, heading + step * bh - third * ah
    cx, cy, ch, _, _, later = rate(at_x, at_y, at, done + 2.0 * third)
    at_x, at_y, at = x + step * (ax - bx + cx), y + step * (ay - by + cy), heading + step * (ah - bh + ch)
    dx, dy, dh, _, _, fourth = rate(at_x, at_y, at, done + step)
    part = 0.125 * step
    after = (
        x + part * (ax + 3.0 * (bx + cx) + dx),
        y + part * (ay + 3.0 * (by + cy) + dy),
        heading + part * (ah + 3.0 * (bh + ch) + dh),
    )
    p, q, r, s = DIFFERENCE
    difference = (
        p * ax + q * bx + r * cx + s * dx,
        p * ay + q * by + r * cy + s * dy,
        p * ah + q * bh + r * ch + s * dh,
    )
    return after, difference, second == kind and later == kind and fourth == kind


def _distance(one: Three, other: Three, length: float) -> float:
    x, y, turn = one[0] - other[0], one[1] - other[1], (one[2] - other[2]) * length
    return sqrt(x * x + y * y + turn * turn)


def _size(difference: Three, last: Rates, length: float) -> float:
    """Of the difference of rates, with that after the step."""
    x, y, turn = difference[0] + AFTER * last[0], difference[1] + AFTER * last[1], difference[2] + AFTER * last[2]
    return sqrt(x * x + y * y + turn * turn * length * length)
