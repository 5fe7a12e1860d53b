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

"""One push in plain numbers: what acts on the slider at each place of the path."""

from __future__ import annotations

from math import atan2, cos, log, sin
from typing import TYPE_CHECKING

from push_predictor.models.mechanics.motion.contact_solution import kind_of
from push_predictor.models.mechanics.motion.friction_cone import REFERENCE_SPEED, SLOWEST
from push_predictor.models.mechanics.motion.sweep import FINE
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
)
from push_predictor.models.mechanics.scalar.sweep import Rate, Rates, swept, swept_finely
from push_predictor.models.mechanics.scalar.values import RecordingErrors, ScalarValues, Two

if TYPE_CHECKING:
    from push_predictor.models.mechanics.scalar.mechanics import ScalarMechanics

NONE = (0.0, 0.0)


class ScalarPush:
    """One push: see recorded_push.TruePush and forward. heading: of the push in the world, rad."""

    def __init__(
        self,
        model: ScalarMechanics,
        values: ScalarValues,
        surface: ScalarSurface,
        velocity: float,
        contact: float,
        angle: float,
        duration: float,
        heading: float,
    ) -> None:
        self.model, self.values, self.surface, self.last = model, values, surface, LastContact()
        x, y, nx, ny = model.contact_at(contact)
        self.radius = radius = model.mechanics.pusher_radius
        self.recorded = _turned(nx, ny, angle)  # direction of the path, as it was recorded
        self.tip, self.origin = (x - radius * nx, y - radius * ny), NONE
        if values.errors is not None:
            self._correct(values.errors, velocity)
        self.ahead = _turned(*self.recorded, values.push_rotation)
        self.speed = velocity * (1.0 + values.travel_share)
        self.travel = self.speed * duration
        self.heading = heading - atan2(self.recorded[1], self.recorded[0])
        world = values.world
        # Without grain:
        self.stretch = None if world.stretch == NONE else root_of_stretch(*world.stretch, surface.reach)
        # What is the same all along the push is computed once; None if it is not.
        self.cone = self._edges(values.friction.usual) if values.same_friction else None
        self.centre = None if world.gradient != NONE else self._own_centre()
        self.twist = self._loaded(0.0) if world.grain == world.slope == NONE else None
        self.ellipsoid = self.twist is not None and is_ellipsoid(self.twist)

    def _correct(self, errors: RecordingErrors, velocity: float) -> None:
        """From what was recorded to where tip and slider truly are."""
        (rx, ry), (x, y), turned = self.recorded, self.tip, errors.rotation
        (shift_x, shift_y), across = errors.outline, errors.across
        along = errors.along + velocity * errors.clock_delay
        self.radius += errors.radius
        x, y = x + along * rx - across * ry, y + along * ry + across * rx
        at_x, at_y, nx, ny, _ = self.model.nearest(*_turned(x - shift_x, y - shift_y, -turned))
        self.tip = at_x + nx * self.radius, at_y + ny * self.radius
        self.recorded, self.origin = _turned(rx, ry, -turned), _turned(-shift_x, -shift_y, -turned)

    def displacement(self) -> Three:
        """Displacement in the recorded push frame."""
        accuracy = self.model.mechanics.accuracy
        sweep = swept if accuracy > FINE else swept_finely
        x, y, turn = sweep(self._rate(), self.travel, self.surface.length, accuracy)
        if self.origin != NONE:
            (ox, oy), (turned_x, turned_y) = self.origin, _turned(*self.origin, turn)
            x, y = x + turned_x - ox, y + turned_y - oy
        ahead_x, ahead_y = self.recorded
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

    def _own_centre(self) -> Two:
        (x, y), (shift_x, shift_y) = self.surface.centre, self.values.centre
        return x + shift_x, y + shift_y

    def _centre(self, heading: float) -> Two:
        x, y = self._own_centre()
        gx, gy = _turned(*self.values.world.gradient, -(self.heading + heading))
        xx, xy, yy = self.surface.square
        return x + xx * gx + xy * gy, y + xy * gx + yy * gy

    def _friction(self, touch: ScalarTouch) -> Two:
        """Coefficients of slip to the left and to the right; see friction_cone."""
        friction, _, by_angle, by_speed, by_load = self.values.friction
        normal_x, normal_y, normal_arm, _, along, across = touch
        if by_angle:
            friction += by_angle * abs(atan2(across, along))
        if by_speed:
            friction += by_speed * log(max(self.speed * abs(across), SLOWEST) / REFERENCE_SPEED)
        if by_load:
            friction -= by_load * log(self.surface.gauge(normal_x, normal_y, normal_arm))
        return self._edges(friction)

    def _edges(self, friction: float) -> Two:
        difference = self.values.friction.difference
        return max(friction + difference, 0.0), max(friction - difference, 0.0)

    def _loaded(self, heading: float) -> Twist:
        """The surface under what acts at this heading; see forward and loaded_surface."""
        world, turn = self.values.world, self.heading + heading
        stretch, pull = self.stretch, None
        if world.grain != NONE:
            a, b = _turned(*world.grain, -2.0 * turn)
            stretch = root_of_stretch(world.stretch[0] + a, world.stretch[1] + b, self.surface.reach)
        if world.slope != NONE:
            pull = (*_turned(*world.slope, -turn), 0.0)
        return loaded(self.surface, stretch, pull, self.values.height)


def _turned(x: float, y: float, angle: float) -> Two:
    if angle == 0.0:
        return x, y
    c, s = cos(angle), sin(angle)
    return c * x - s * y, s * x + c * y
