"""The exact forward model: displacement(parameters, pushes), from any outline and pressure distribution.

Four exchangeable parts: the limit surface (load_map, or surfaces for the cheap approximations), the contact
(contact_solution, with a friction law of few numbers), the kinematics of the measurement, and the world.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from push_predictor.geometry.frames import rotate, to_body
from push_predictor.geometry.outline import Outline, Projection
from push_predictor.models.mechanics.contact_solution import Driven, Touch, TwistOf, driven
from push_predictor.models.mechanics.load_map import LoadMap, load_map
from push_predictor.models.mechanics.parameters import BY_NAME, ParameterValues
from push_predictor.models.mechanics.pressure import PressureDistribution, patch
from push_predictor.models.mechanics.support_surfaces import RowSurfaces, SameSurface, row_surfaces
from push_predictor.models.mechanics.surfaces import PowerSurface
from push_predictor.models.mechanics.sweep import swept
from push_predictor.types import Array, IntArray

EXPONENT_KNOTS = (-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 12.0)
REFERENCE_SPEED = 0.02  # m/s, at which friction_by_speed is zero
SLOWEST = 1e-4  # m/s, of a tangential speed
BEND_STEP = 5e-4  # m of the tip's path, over which the acceleration of the slider is taken
SQUARE_OF_SPREAD = 9.0 / 16.0  # mean square of a coordinate over c squared, of an even disc


@dataclass(frozen=True, eq=False)
class PushMechanics:
    """Quasi-static mechanics of a slider under a disc of pusher_radius (m).

    support: of every push: a known pressure distribution, a PowerSurface as a cheap approximation of the limit surface,
    or None for a patch over the outline, whose pressure the parameter rim_exponent changes. supports: others by the
    covariate `recording`, where recordings had different supports.
    """

    outline: Outline
    pusher_radius: float
    support: PressureDistribution | PowerSurface | None = None
    supports: Mapping[int, PressureDistribution] = field(default_factory=dict)
    _tables: dict[object, LoadMap] = field(default_factory=dict)

    def displacement(
        self, values: ParameterValues, inputs: Array, duration: Array, covariates: Mapping[str, Array] | None = None
    ) -> Array:
        """Displacement (n, 3: dx, dy in m, dtheta in rad) of the recorded origin in the recorded push frame.

        values: of parameters.PARAMETERS, each a number or (n,). inputs (n, 3): velocity m/s, contact, angle rad;
        duration (n,) s. Raises KeyError for a covariate that a parameter needs.
        """
        rows = _Values(values, len(inputs), covariates or {})
        return _Sweep(self, self._surfaces(rows), rows, inputs, duration).displacement()

    def _patch(self, exponent: float) -> LoadMap:
        if exponent not in self._tables:
            self._tables[exponent] = load_map(patch(self.outline, exponent))
        return self._tables[exponent]

    def _known(self, key: str, support: PressureDistribution) -> LoadMap:
        if key not in self._tables:
            self._tables[key] = load_map(support)
        return self._tables[key]

    def _surfaces(self, values: _Values) -> RowSurfaces | SameSurface:
        n = values.n
        if isinstance(self.support, PowerSurface):
            return SameSurface(self.support, np.tile(self.support.centre, (n, 1)), np.full(n, self.support.length))
        known = [] if self.support is None else [self._known("support", self.support)]
        number = np.where(np.full(n, bool(known)), 0, -1)
        if self.supports and "recording" in values.covariates:
            for recording, support in self.supports.items():
                number[values.covariates["recording"] == recording] = len(known)
                known.append(self._known(f"recording {recording}", support))
        below, share, used = self._exponents(values.of("rim_exponent"), number < 0)
        maps = [*known, *(self._patch(exponent) for exponent in used)]
        low = np.where(number < 0, len(known) + below, number)
        return row_surfaces(maps, low, np.minimum(low + 1, len(maps) - 1), share)

    def _exponents(self, exponent: Array, on_patch: np.ndarray) -> tuple[IntArray, Array, list[float]]:
        """For each push, the index of the tabulated exponent below its own, the share of the next, and the used ones."""
        if not on_patch.any():
            return np.zeros(len(exponent), dtype=np.int64), np.zeros(len(exponent)), []
        knots = np.asarray(EXPONENT_KNOTS)
        exponent = np.clip(exponent, knots[0], knots[-1])
        below = np.minimum(np.searchsorted(knots, exponent, side="right") - 1, len(knots) - 2)
        share = np.where(on_patch, (exponent - knots[below]) / (knots[below + 1] - knots[below]), 0.0)
        first, last = int(below[on_patch].min()), int((below + (share > 0.0))[on_patch].max())
        return np.maximum(below - first, 0), share, list(EXPONENT_KNOTS[first : last + 1])


class _Values:
    """Values of the parameters of n pushes, and their covariates."""

    def __init__(self, values: ParameterValues, n: int, covariates: Mapping[str, Array]) -> None:
        unknown = set(values) - set(BY_NAME)
        if unknown:
            raise KeyError(f"{sorted(unknown)[0]!r} is no parameter of the mechanics: {', '.join(BY_NAME)}")
        self.n, self.covariates, self._values = n, covariates, values

    def of(self, name: str) -> Array:
        """(n,) of a parameter."""
        return np.broadcast_to(np.asarray(self._values.get(name, BY_NAME[name].textbook), dtype=np.float64), self.n)

    def active(self, *names: str) -> bool:
        """Whether any of these differs from zero."""
        return any(np.any(np.asarray(self._values.get(name, 0.0)) != 0.0) for name in names)

    def pair(self, first: str, second: str) -> Array:
        """(n, 2) of two parameters."""
        return np.column_stack([self.of(first), self.of(second)])


class _Sweep:
    """The pushes as they truly were, and how they were recorded."""

    def __init__(
        self,
        mechanics: PushMechanics,
        surface: RowSurfaces | SameSurface,
        values: _Values,
        inputs: Array,
        duration: Array,
    ) -> None:
        self.mechanics, self.surface, self.values = mechanics, surface, values
        velocity, contact, angle = np.asarray(inputs, dtype=np.float64).T
        outline, self.radius = mechanics.outline, mechanics.pusher_radius + values.of("radius_error")
        normal = outline.inward_normal(contact)
        self.recorded = rotate(normal, angle)  # direction of the push, in the recorded body frame
        along = values.of("tip_offset_along") + velocity * values.of("clock_delay")
        tip = outline.point(contact) - mechanics.pusher_radius * normal
        tip = tip + along[:, None] * self.recorded + values.of("tip_offset_across")[:, None] * _left(self.recorded)
        shift, turned = values.pair("outline_x", "outline_y"), values.of("tracker_rotation")
        self.speed, self.travel = velocity, velocity * duration * (1.0 + values.of("travel_share"))
        self.frame = rotate(self.recorded, -turned)  # the same direction in the true body frame
        self.ahead = rotate(self.frame, values.of("push_rotation"))
        self.origin = rotate(-shift, -turned)  # the recorded origin in the true body frame
        self.tip = self._in_contact(rotate(tip - shift, -turned), normal, contact)
        self._world()

    def _in_contact(self, tip: Array, normal: Array, contact: Array) -> Array:
        """The tips, moved along the outline's normal until they touch: a window begins in contact."""
        moved = ("outline_x", "outline_y", "tracker_rotation", "radius_error")
        if not self.values.active("tip_offset_along", "tip_offset_across", "clock_delay", *moved):
            return tip
        nearest = self.mechanics.outline.project(tip)
        return np.asarray(nearest.point + nearest.normal * self.radius[:, None])

    def _world(self) -> None:
        """Heading of the true body in the world at the start, where a parameter needs it."""
        values = self.values
        self.heading = np.zeros(values.n)
        if values.active("grain_x", "grain_diagonal", "slope_x", "slope_y", "gradient_x", "gradient_y"):
            self.heading = values.covariates["push_heading"] - np.arctan2(self.frame[:, 1], self.frame[:, 0])
        self.stretch = values.pair("body_anisotropy", "body_anisotropy_diagonal")
        self.grain = values.pair("grain_x", "grain_diagonal")
        self.slope = values.pair("slope_x", "slope_y")
        self.gradient = values.pair("gradient_x", "gradient_y") * (SQUARE_OF_SPREAD * self.surface.length[:, None] ** 2)
        self.centre = self.surface.centre + values.pair("centre_x", "centre_y")

    def displacement(self) -> Array:
        """See PushMechanics.displacement."""
        pose = swept(self._rate, self.travel, self.surface.length)
        moved = pose[:, :2] + rotate(self.origin, pose[:, 2]) - self.origin
        heading = np.arctan2(self.frame[:, 1], self.frame[:, 0])
        return np.column_stack([rotate(moved, -heading), pose[:, 2]])

    def _rate(self, rows: IntArray, pose: Array, done: Array) -> tuple[Array, Array, Array]:
        if not self.values.active("inertia"):
            return self._quasi_static(rows, pose, done, None)
        rate, gap, along = self._quasi_static(rows, pose, done, None)
        later = self._quasi_static(rows, pose + BEND_STEP * rate, done + BEND_STEP, None)[0]
        bend = (later - rate) / BEND_STEP
        # Moment of inertia over mass is twice the mean square of a coordinate.
        force = rotate(bend[:, :2], -pose[:, 2])
        pull = np.column_stack([force, 2.0 * SQUARE_OF_SPREAD * self.surface.length[rows] * bend[:, 2]])
        share = self.values.of("inertia")[rows] * self.speed[rows] ** 2
        size = np.maximum(1.0, np.linalg.norm(pull, axis=1) * share / 0.8)  # more would not be a correction
        return self._quasi_static(rows, pose, done, -(share / size)[:, None] * pull)

    def _quasi_static(
        self, rows: IntArray, pose: Array, done: Array, inertial: Array | None
    ) -> tuple[Array, Array, Array]:
        """Change of the poses per metre of the tip's path, gap (m) and the approach of the disc."""
        heading, length = pose[:, 2], self.surface.length[rows]
        tip = self.tip[rows] + done[:, None] * self.ahead[rows]
        nearest = self.mechanics.outline.project(to_body(tip, pose))
        velocity = rotate(self.ahead[rows], -heading)
        centre = self.centre[rows] + rotate(self.gradient[rows], -(self.heading[rows] + heading))
        touch = _touch(nearest, velocity, centre, length)
        motion = self._driven(rows, heading, touch, inertial)
        if self.values.active("pushing_height"):
            push, rub = np.cos(motion.force_angle), np.sin(motion.force_angle)
            size = np.sqrt(1.0 + (push * touch.normal_arm + rub * touch.left_arm) ** 2)
            x, y = push * touch.normal_x - rub * touch.normal_y, push * touch.normal_y + rub * touch.normal_x
            centre = centre + (self.values.of("pushing_height")[rows] / size)[:, None] * np.column_stack([x, y])
            touch = _touch(nearest, velocity, centre, length)
            motion = self._driven(rows, heading, touch, inertial)
        spin = motion.spin / length
        vx, vy = motion.vx + spin * centre[:, 1], motion.vy - spin * centre[:, 0]
        cos, sin = np.cos(heading), np.sin(heading)
        rate = np.stack([cos * vx - sin * vy, sin * vx + cos * vy, spin], axis=1)
        return rate, nearest.distance - self.radius[rows], touch.along

    def _driven(self, rows: IntArray, heading: Array, touch: Touch, inertial: Array | None) -> Driven:
        left, right = self._cone(rows, touch)
        stretch = None
        if self.values.active("body_anisotropy", "body_anisotropy_diagonal", "grain_x", "grain_diagonal"):
            stretch = self.stretch[rows] + rotate(self.grain[rows], -2.0 * (self.heading[rows] + heading))
        pull = inertial
        if self.values.active("slope_x", "slope_y"):
            slope = rotate(self.slope[rows], -(self.heading[rows] + heading))
            steady = np.column_stack([slope, np.zeros(len(rows))])
            pull = steady if pull is None else pull + steady
        return driven(_changed(partial(self.surface.twist, rows), stretch, pull), touch, left, right)

    def _cone(self, rows: IntArray, touch: Touch) -> tuple[Array, Array]:
        """Angles of the friction cone's edges to the left and to the right, rad."""
        values = self.values
        friction = values.of("contact_friction")[rows]
        if values.active("friction_by_angle"):
            friction = friction + values.of("friction_by_angle")[rows] * np.abs(np.arctan2(touch.across, touch.along))
        if values.active("friction_by_speed"):
            speed = np.maximum(self.speed[rows] * np.abs(touch.across), SLOWEST)
            friction = friction + values.of("friction_by_speed")[rows] * np.log(speed / REFERENCE_SPEED)
        if values.active("friction_by_load"):
            force = 1.0 / np.sqrt(1.0 + touch.normal_arm**2)  # over the largest; that of an ellipsoid
            friction = friction + values.of("friction_by_load")[rows] * np.log(force)
        difference = values.of("friction_difference")[rows]
        return np.arctan(np.maximum(friction + difference, 0.0)), np.arctan(np.maximum(friction - difference, 0.0))


def _left(direction: Array) -> Array:
    return np.column_stack([-direction[:, 1], direction[:, 0]])


def _touch(nearest: Projection, velocity: Array, centre: Array, length: Array) -> Touch:
    nx, ny = -nearest.normal[:, 0], -nearest.normal[:, 1]
    x, y = (nearest.point[:, 0] - centre[:, 0]) / length, (nearest.point[:, 1] - centre[:, 1]) / length
    vx, vy = velocity[:, 0], velocity[:, 1]
    return Touch(nx, ny, x * ny - y * nx, x * nx + y * ny, vx * nx + vy * ny, vy * nx - vx * ny)


def _changed(surface: TwistOf, stretch: Array | None, pull: Array | None) -> TwistOf:
    """The surface's twist with friction that depends on direction, and a steady load in addition to the pusher's.

    A point at velocity u resists with S S u / |S u|, with S = W^-1/2: the same points with the velocity S v and the
    arms det(S) S^-1 r have isotropic friction. The change of the arms is of second order and left out.
    """
    if stretch is None and pull is None:
        return surface

    def twist(force_x: Array, force_y: Array, moment: Array) -> tuple[Array, Array, Array]:
        x, y, m = force_x, force_y, moment
        if pull is not None:
            x, y, m = _with_pull(x, y, m, pull)
        if stretch is None:
            return surface(x, y, m)
        a, b = 0.5 * stretch[:, 0], 0.5 * stretch[:, 1]  # of the root of W, to first order
        vx, vy, spin = surface((1.0 + a) * x + b * y, b * x + (1.0 - a) * y, m)
        return (1.0 + a) * vx + b * vy, b * vx + (1.0 - a) * vy, spin

    return twist


def _with_pull(x: Array, y: Array, m: Array, pull: Array) -> tuple[Array, Array, Array]:
    """The load on the limit surface: the pusher's, as large as it must be, and the pull (n, 3) in units of the largest.

    The size is that on an ellipsoid.
    """
    size = np.sqrt(x * x + y * y + m * m)
    x, y, m = x / size, y / size, m / size
    gx, gy, gm = pull.T
    dot = x * gx + y * gy + m * gm
    share = -dot + np.sqrt(np.maximum(dot * dot + 1.0 - (gx * gx + gy * gy + gm * gm), 1e-6))
    return size * (share * x + gx), size * (share * y + gy), size * (share * m + gm)
