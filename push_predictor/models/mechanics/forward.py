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

"""The exact forward model: displacement(parameters, pushes), from any outline and pressure distribution.

Four exchangeable parts: the limit surface (load_map, or surfaces for the cheap approximations), the contact
(contact_solution, with the friction law of friction_cone), the kinematics of the measurement (recorded_push), and the
world (loaded_surface).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from push_predictor.geometry.frames import paired, rotate
from push_predictor.geometry.outline import Outline, Projection
from push_predictor.models.mechanics.limit_surfaces.direction_dependence import Root, root_of
from push_predictor.models.mechanics.limit_surfaces.load_map import LoadMap, load_map
from push_predictor.models.mechanics.limit_surfaces.loaded_surface import LoadedSurface
from push_predictor.models.mechanics.limit_surfaces.support_surfaces import (
    PushSurfaces,
    RowSurfaces,
    SameSurface,
    row_surfaces,
    same_surface,
)
from push_predictor.models.mechanics.limit_surfaces.surfaces import PowerSurface
from push_predictor.models.mechanics.motion.contact_solution import (
    RESTS,
    Driven,
    Touch,
    driven,
    driven_on_ellipsoid,
    kind_of,
)
from push_predictor.models.mechanics.motion.fine_sweep import KindRates, swept_finely
from push_predictor.models.mechanics.motion.friction_cone import friction_cone
from push_predictor.models.mechanics.motion.recorded_push import TruePush, true_push
from push_predictor.models.mechanics.motion.sweep import FINE, Rates, swept
from push_predictor.models.mechanics.parameters import ParameterValues, RowValues
from push_predictor.models.mechanics.pressure import PressureDistribution, patch
from push_predictor.types import Array, IntArray

EXPONENT_KNOTS = (-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 12.0)
BEND_STEP = 5e-4  # m of the tip's path, over which the acceleration of the slider is taken
MOST_INERTIA = 0.8  # of the largest load: more would not be a correction


@dataclass(frozen=True)
class _Patch:
    """An outline and its pressure; equal for equal outlines, so that all models of a slider share a table."""

    vertices: bytes
    semi_axes: tuple[float, float] | None
    exponent: float
    outline: Outline = field(compare=False)


@lru_cache(maxsize=64)
def _tabulated(key: _Patch) -> LoadMap:
    return load_map(patch(key.outline, key.exponent))


def _patch_map(outline: Outline, exponent: float) -> LoadMap:
    """The inverse of an outline's patch; it takes 0.1 s to tabulate."""
    return _tabulated(_Patch(outline.vertices.tobytes(), outline.semi_axes, exponent, outline))


@dataclass(frozen=True, eq=False)
class PushMechanics:
    """Quasi-static mechanics of a slider under a disc of pusher_radius (m).

    support: of every push: a known pressure distribution, a PowerSurface as a cheap approximation of the limit surface,
    or None for a patch over the outline, whose pressure the parameter rim_exponent changes. supports: others by the
    covariate `recording`, where recordings had different supports. accuracy: of a displacement, relative.
    """

    outline: Outline
    pusher_radius: float
    support: PressureDistribution | PowerSurface | None = None
    supports: Mapping[int, PressureDistribution] = field(default_factory=dict)
    accuracy: float = 1e-3
    _tables: dict[object, LoadMap] = field(default_factory=dict)

    def displacement(
        self, values: ParameterValues, inputs: Array, duration: Array, covariates: Mapping[str, Array] | None = None
    ) -> Array:
        """Displacement (n, 3: dx, dy in m, dtheta in rad) of the recorded origin in the recorded push frame.

        values: of parameters.PARAMETERS, each a number or (n,). inputs (n, 3): velocity m/s, contact, angle rad;
        duration (n,) s. Raises KeyError for a covariate that a parameter needs.
        """
        if not len(inputs):
            return np.zeros((0, 3))
        rows = RowValues(values, len(inputs), covariates or {})
        push = true_push(self.outline, self.pusher_radius, rows, inputs, np.asarray(duration, dtype=np.float64))
        return push.recorded_displacement(self.poses(rows, push))

    def poses(self, values: RowValues, push: TruePush) -> Array:
        """Poses (n, 3: x, y in m, heading in rad) of sliders after true pushes, in the frames of their first poses."""
        motion = Motion(self, values, push)
        if self.accuracy > FINE:
            return swept(motion.rate, push.travel, motion.length, self.accuracy)
        return swept_finely(motion.rate_and_kind, push.travel, motion.length, self.accuracy)

    def _known(self, key: str, support: PressureDistribution) -> LoadMap:
        if key not in self._tables:
            self._tables[key] = load_map(support)
        return self._tables[key]

    def surfaces(self, values: RowValues) -> PushSurfaces:
        """Limit surfaces of pushes with these values; tabulates what is not tabulated yet."""
        found = self._unspread(values)
        if not values.active("pressure_spread"):
            return found
        return replace(found, of_rows=found.of_rows.spread(np.exp(values.of("pressure_spread"))))

    def _unspread(self, values: RowValues) -> RowSurfaces | SameSurface:
        n = values.n
        if isinstance(self.support, PowerSurface):
            return same_surface(self.support, n)
        known = [] if self.support is None else [self._known("support", self.support)]
        number = np.where(np.full(n, bool(known)), 0, -1)
        if self.supports and "recording" in values.covariates:
            for recording, support in self.supports.items():
                number[values.covariates["recording"] == recording] = len(known)
                known.append(self._known(f"recording {recording}", support))
        below, share, used = self._exponents(values.of("rim_exponent"), number < 0)
        maps = [*known, *(_patch_map(self.outline, exponent) for exponent in used)]
        low = np.where(number < 0, len(known) + below, number)
        return row_surfaces(maps, low, np.minimum(low + 1, len(maps) - 1), share)

    def _exponents(self, exponent: Array, on_patch: np.ndarray) -> tuple[IntArray, Array, list[float]]:
        """Per push, the index of the tabulated exponent below its own and the share of the next; the used ones."""
        if not on_patch.any():
            return np.zeros(len(exponent), dtype=np.int64), np.zeros(len(exponent)), []
        knots = np.asarray(EXPONENT_KNOTS)
        exponent = np.clip(exponent, knots[0], knots[-1])
        below = np.minimum(np.searchsorted(knots, exponent, side="right") - 1, len(knots) - 2)
        share = np.where(on_patch, (exponent - knots[below]) / (knots[below + 1] - knots[below]), 0.0)
        first, last = int(below[on_patch].min()), int((below + (share > 0.0))[on_patch].max())
        return np.maximum(below - first, 0), share, list(EXPONENT_KNOTS[first : last + 1])


class _Instant(NamedTuple):
    """Rates, and the contacts and motions that they are of."""

    rates: Rates
    nearest: Projection
    touch: Touch
    motion: Driven


class Motion:
    """The motion of sliders under pushes."""

    def __init__(self, mechanics: PushMechanics, values: RowValues, push: TruePush) -> None:
        self.mechanics, self.values, self.push = mechanics, values, push
        self.surfaces = mechanics.surfaces(values)
        of_rows = self.surfaces.of_rows
        self.length, self.centre = of_rows.length, of_rows.centre + values.pair("centre_x", "centre_y")
        self.heading = np.zeros(values.n)  # of the slider in the world at the start, where a parameter needs it
        if values.active("grain_x", "grain_diagonal", "slope_x", "slope_y", "gradient_x", "gradient_y"):
            self.heading = values.covariates["push_heading"] - push.recorded_angle
        self.stretch = values.pair("body_anisotropy", "body_anisotropy_diagonal")
        self.grain, self.slope = values.pair("grain_x", "grain_diagonal"), values.pair("slope_x", "slope_y")
        self.gradient, self.square = values.pair("gradient_x", "gradient_y"), of_rows.square

    def rate(self, rows: IntArray, pose: Array, done: Array) -> Rates:
        """Change of the poses per metre of the tip's path, gap (m) and approach of the disc."""
        return self._at(rows, pose, done).rates

    def rate_and_kind(self, rows: IntArray, pose: Array, done: Array) -> KindRates:
        """The same, and the kind of contact: see fine_sweep."""
        found = self._at(rows, pose, done)
        return *found.rates, self._kind(found)

    def _at(self, rows: IntArray, pose: Array, done: Array) -> _Instant:
        found = self._quasi_static(rows, pose, done, None)
        if not self.values.active("inertia"):
            return found
        ahead = pose + BEND_STEP * found.rates[0]
        later = self._quasi_static(rows, ahead, done + BEND_STEP, None).rates[0]
        centre = self.centre[rows]  # of mass: above that of the pressure while the slider rests
        bend = _of_point(later, ahead, centre) - _of_point(found.rates[0], pose, centre)
        return self._quasi_static(rows, pose, done, self._inertial(rows, pose, bend / BEND_STEP))

    def _inertial(self, rows: IntArray, pose: Array, bend: Array) -> Array:
        """Load (k, 3) of the mass that accelerates (D'Alembert), in units of the largest friction; bend: per metre."""
        force = rotate(bend[:, :2], -pose[:, 2])
        turning = self.mechanics.outline.polar_moment / self.length[rows] * bend[:, 2]
        load = np.column_stack([force, turning])
        share = self.values.of("inertia")[rows] * self.push.speed[rows] ** 2
        size = np.maximum(1.0, np.linalg.norm(load, axis=1) * np.abs(share) / MOST_INERTIA)
        return np.asarray(-(share / size)[:, None] * load)

    def _quasi_static(self, rows: IntArray, pose: Array, done: Array, inertial: Array | None) -> _Instant:
        (x, y, heading), length = pose.T, self.length[rows]
        (tip_x, tip_y), (ahead_x, ahead_y) = self.push.tip[rows].T, self.push.ahead[rows].T
        cos, sin = np.cos(heading), np.sin(heading)  # once, for three rotations: `rotate` would repeat them
        from_x, from_y = tip_x + done * ahead_x - x, tip_y + done * ahead_y - y
        nearest = self.mechanics.outline.project(paired(cos * from_x + sin * from_y, cos * from_y - sin * from_x))
        centre = self._centre(rows, heading)
        ahead = cos * ahead_x + sin * ahead_y, cos * ahead_y - sin * ahead_x
        touch = _touch(nearest, ahead, centre, length)
        motion = self._driven(rows, heading, touch, inertial)
        spin = motion.spin / length
        vx, vy = motion.vx + spin * centre[:, 1], motion.vy - spin * centre[:, 0]
        rate = np.empty_like(pose)
        rate[:, 0], rate[:, 1], rate[:, 2] = cos * vx - sin * vy, sin * vx + cos * vy, spin
        return _Instant((rate, nearest.distance - self.push.radius[rows], touch.along), nearest, touch, motion)

    def _kind(self, found: _Instant) -> Array:
        """Of contacts (k,): slip and edge in one number; none is like that at a corner, where the normal turns."""
        touch, slip = found.touch, np.where(found.touch.along > 0.0, found.motion.slip, RESTS)
        if self.mechanics.outline.semi_axes is not None:
            return slip
        return np.where(found.nearest.at_vertex, np.nan, kind_of(slip, touch.normal_x, touch.normal_y))

    def _centre(self, rows: IntArray, heading: Array) -> Array:
        """Centre of friction (k, 2): a friction that grows along a direction moves it by the mean square there."""
        if not self.values.active("gradient_x", "gradient_y"):
            return np.asarray(self.centre[rows])
        (x, y), (xx, xy, yy) = rotate(self.gradient[rows], -(self.heading[rows] + heading)).T, self.square[rows].T
        return np.asarray(self.centre[rows] + np.column_stack([xx * x + xy * y, xy * x + yy * y]))

    def _driven(self, rows: IntArray, heading: Array, touch: Touch, inertial: Array | None) -> Driven:
        values, world = self.values, self.heading[rows] + heading
        root, pull = self._root_of(rows, world), inertial
        if values.active("slope_x", "slope_y"):
            steady = np.column_stack([rotate(self.slope[rows], -world), np.zeros(len(rows))])
            pull = steady if pull is None else pull + steady
        height = values.of("pushing_height")[rows] if values.active("pushing_height") else None
        gauge = np.ones(0)
        if values.active("friction_by_load"):
            gauge = self.surfaces.gauge(rows, touch.normal_x, touch.normal_y, touch.normal_arm)
        left, right = friction_cone(values, rows, touch, self.push.speed[rows], gauge)
        if self._plain and root is None and pull is None and height is None:
            return driven_on_ellipsoid(touch, np.tan(left))
        return driven(LoadedSurface(self.surfaces, rows, root, pull, height).twist, touch, left, right)

    def _root_of(self, rows: IntArray, world: Array) -> Root | None:
        """Of the direction-dependent friction at headings in the world (k,): only the table's depends on these."""
        if self.values.active("grain_x", "grain_diagonal"):
            stretch = self.stretch[rows] + rotate(self.grain[rows], -2.0 * world)
            return root_of(stretch, self.surfaces.of_rows.reach[rows])
        if self.values.active("body_anisotropy", "body_anisotropy_diagonal"):
            return self._body_root.of(rows)
        return None

    @cached_property
    def _body_root(self) -> Root:
        return root_of(self.stretch, self.surfaces.of_rows.reach)

    @property
    def _plain(self) -> bool:
        """Whether the surface is an ellipsoid, and friction the same to both sides."""
        support = self.mechanics.support
        ellipsoid = isinstance(support, PowerSurface) and support.power == 2.0
        return ellipsoid and not self.values.active("friction_difference")


def _of_point(rate: Array, pose: Array, point: Array) -> Array:
    """Rates (k, 3) of a point of the body (k, 2) from those of its origin."""
    x, y = rotate(point, pose[:, 2]).T
    return np.asarray(rate + rate[:, 2:] * np.column_stack([-y, x, np.zeros(len(x))]))


def _touch(nearest: Projection, velocity: tuple[Array, Array], centre: Array, length: Array) -> Touch:
    nx, ny = -nearest.normal[:, 0], -nearest.normal[:, 1]
    x, y = (nearest.point[:, 0] - centre[:, 0]) / length, (nearest.point[:, 1] - centre[:, 1]) / length
    vx, vy = velocity
    return Touch(nx, ny, x * ny - y * nx, x * nx + y * ny, vx * nx + vy * ny, vy * nx - vx * ny)
