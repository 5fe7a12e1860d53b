# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Planned pushes: contact, angle, speed and travel of each, and the straight path of the tip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.geometry.frames import rotate, to_world
from push_predictor.geometry.outline import Outline
from push_predictor.types import Array

APPROACH = 0.004  # m between the tip and the commanded touch, at least
CRUISE_BEFORE_TOUCH = 0.002  # m at full speed before the touch
HOLD = 0.05  # s at rest at the end of the push
RETRACT = 0.003  # m
RETRACT_SPEED = 0.05  # m/s


@dataclass(frozen=True, eq=False)
class PushPlan:
    """The commands of n pushes.

    contact (n,) in [0, 1), angle (n,) rad from the inward normal, speed (n,) m/s, travel (n,) m beyond the commanded
    touch. Raises RequestError for a value out of range.
    """

    contact: Array
    angle: Array
    speed: Array
    travel: Array

    def __post_init__(self) -> None:
        if len(self.contact) == 0:
            raise RequestError("pushes", 0, "a plan of at least one push")
        _demand("contact", self.contact, (self.contact >= 0.0) & (self.contact < 1.0), "a number in [0, 1)")
        _demand("angle", self.angle, np.abs(self.angle) < np.pi / 2.0, "an angle within (-pi/2, pi/2) rad")
        _demand("speed", self.speed, (self.speed > 0.0) & (self.speed <= 1.0), "a speed in (0, 1] m/s")
        _demand("travel", self.travel, (self.travel > 0.0) & (self.travel <= 0.2), "a travel in (0, 0.2] m")

    def __len__(self) -> int:
        return len(self.contact)

    def take(self, rows: Array | slice | np.ndarray) -> PushPlan:
        """The given rows (indices, mask or slice)."""
        return PushPlan(self.contact[rows], self.angle[rows], self.speed[rows], self.travel[rows])


def random_pushes(
    n: int,
    speeds: Sequence[float],
    travel: float = 0.03,
    rng: np.random.Generator | None = None,
    angle_limit: float = 1.2,
) -> PushPlan:
    """Plan n random pushes.

    The contact is uniform over the perimeter, the angle uniform within the limit, the speed one of `speeds`.
    """
    rng = rng or np.random.default_rng(0)
    contact, angle = rng.random(n), rng.uniform(-angle_limit, angle_limit, n)
    return PushPlan(contact, angle, rng.choice(np.asarray(speeds, dtype=np.float64), n), np.full(n, travel))


def grid_pushes(
    contacts: Sequence[float] | Array,
    angles: Sequence[float] | Array,
    repetitions: int,
    speed: float = 0.02,
    travel: float = 0.01,
) -> PushPlan:
    """Plan every contact with every angle, and repeat the whole grid `repetitions` times.

    The defaults are those of Bauza & Rodriguez 2017: 1 cm at 20 mm/s.
    """
    contact, angle = (grid.ravel() for grid in np.meshgrid(contacts, angles, indexing="ij"))
    n = len(contact) * repetitions
    return PushPlan(np.tile(contact, repetitions), np.tile(angle, repetitions), np.full(n, speed), np.full(n, travel))


@dataclass(frozen=True, eq=False)
class PusherPath:
    """Straight paths of n tips.

    From start (n, 2) along direction (n, 2), length (n,) m at speed (n,) m/s with ramps of `acceleration` m/s^2, then
    HOLD s at rest, then back by RETRACT.
    """

    start: Array
    direction: Array
    length: Array
    speed: Array
    acceleration: float

    @property
    def push_time(self) -> Array:
        """Time (n,) in s until the tip stops at the end of its path."""
        return ramp_time(self.length, self.speed, self.acceleration)

    @property
    def total_time(self) -> Array:
        """Time (n,) in s until the tip has retracted."""
        return self.push_time + HOLD + ramp_time(np.array(RETRACT), np.array(RETRACT_SPEED), self.acceleration)

    def position(self, time: Array) -> Array:
        """Tip centres (..., n, 2) in m, time (..., n) s after the start."""
        out = ramp_distance(time, self.length, self.speed, self.acceleration)
        later = time - self.push_time - HOLD
        back = ramp_distance(later, np.array(RETRACT), np.array(RETRACT_SPEED), self.acceleration)
        return np.asarray(self.start + (out - back)[..., None] * self.direction)

    def take(self, rows: np.ndarray) -> PusherPath:
        """The given rows."""
        return PusherPath(
            self.start[rows], self.direction[rows], self.length[rows], self.speed[rows], self.acceleration
        )


def pusher_path(plan: PushPlan, outline: Outline, radius: float, poses: Array, acceleration: float) -> PusherPath:
    """The paths of a plan on sliders at poses (n, 3); each tip reaches its speed before it touches."""
    inward = outline.inward_normal(plan.contact)
    direction = rotate(rotate(inward, plan.angle), poses[:, 2])
    touch = to_world(outline.point(plan.contact) - radius * inward, poses)
    approach = np.maximum(APPROACH, plan.speed**2 / (2.0 * acceleration) + CRUISE_BEFORE_TOUCH)
    start = touch - approach[:, None] * direction
    return PusherPath(start, direction, approach + plan.travel, plan.speed, acceleration)


def ramp_time(length: Array, speed: Array, acceleration: float) -> Array:
    """Duration of a trapezoidal motion, s."""
    peak = np.minimum(speed, np.sqrt(acceleration * length))
    return peak / acceleration + length / peak


def ramp_distance(time: Array, length: Array, speed: Array, acceleration: float) -> Array:
    """Distance travelled after `time` of a trapezoidal motion, m.

    Zero before its start, `length` after its end.
    """
    peak = np.minimum(speed, np.sqrt(acceleration * length))
    ramp = peak / acceleration
    cruise = length / peak - ramp
    first = np.clip(time, 0.0, ramp)
    last = np.clip(time - ramp - cruise, 0.0, ramp)
    middle = np.clip(time - ramp, 0.0, cruise)
    return np.asarray(acceleration * first**2 / 2.0 + peak * middle + peak * last - acceleration * last**2 / 2.0)


def _demand(field: str, values: Array, good: np.ndarray, accepted: str) -> None:
    if not np.all(good):
        raise RequestError(field, float(values[~good][0]), accepted)
