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

"""Limit surfaces: from the direction of a load to a twist. The exact one of a pressure distribution is in load_map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from push_predictor.types import Array

DIRECTIONS = 16  # of arms, over half a turn
SQUARE_OF_SPREAD = 9.0 / 16.0  # mean square of a coordinate over c squared, of an even disc


class LimitSurface(Protocol):
    """A limit surface about a centre (2,) in m, body frame, with a length c in m by which moments are divided.

    Forces are in units of the friction force of a body that slides without turning.
    """

    @property
    def centre(self) -> Array:
        """Centre of friction (2,), m, body frame."""

    @property
    def length(self) -> float:
        """Length c, m: maximum moment over maximum force, or near it."""

    @property
    def square(self) -> Array:
        """Mean squares (3,) of the pressure about the centre: xx, xy, yy, m^2."""

    @property
    def reach(self) -> Array:
        """Shares (DIRECTIONS,) of the length by the direction of the arm; see spread_by_direction."""

    def twist(self, force_x: Array, force_y: Array, moment: Array) -> tuple[Array, Array, Array]:
        """Twist (vx, vy, w times c) up to a positive factor, of a force and a moment about the centre over c."""

    def gauge(self, force_x: Array, force_y: Array, moment: Array) -> Array:
        """Size of a load in units of that on the limit surface in the same direction."""


@dataclass(frozen=True, eq=False)
class PowerSurface:
    """The cheap approximation (f / fmax)^p + (m / mmax)^p = 1; p = 2 is the ellipsoid of Lynch et al. (1992)."""

    centre: Array
    length: float
    power: float = 2.0

    @property
    def square(self) -> Array:
        """See LimitSurface: that of an even disc."""
        return SQUARE_OF_SPREAD * self.length**2 * np.array([1.0, 0.0, 1.0])

    @property
    def reach(self) -> Array:
        """See LimitSurface: that of a disc."""
        return np.full(DIRECTIONS, 1.0 / DIRECTIONS)

    def twist(self, force_x: Array, force_y: Array, moment: Array) -> tuple[Array, Array, Array]:
        """See LimitSurface."""
        if self.power == 2.0:
            return force_x, force_y, moment
        force = np.maximum(np.sqrt(force_x**2 + force_y**2), np.finfo(np.float64).tiny)
        size = np.sqrt(force**2 + moment**2)  # the twist is linear in the size of the load
        scale = (force / size) ** (self.power - 2.0)
        spin = np.abs(moment / size) ** (self.power - 1.0) * np.sign(moment) * size
        return scale * force_x, scale * force_y, spin

    def gauge(self, force_x: Array, force_y: Array, moment: Array) -> Array:
        """See LimitSurface."""
        force = np.sqrt(force_x**2 + force_y**2)
        return np.asarray((force**self.power + np.abs(moment) ** self.power) ** (1.0 / self.power))


def spread_by_direction(points: Array, shares: Array) -> Array:
    """Shares (DIRECTIONS,) of the mean distance of points (k, 2) from the origin, by direction over half a turn.

    Direction k is k pi / DIRECTIONS; an arm between two directions counts for both in proportion.
    """
    distance = shares * np.linalg.norm(points, axis=1)
    place = np.arctan2(points[:, 1], points[:, 0]) % np.pi * (DIRECTIONS / np.pi)
    below = place.astype(np.int64)
    part, found = place - below, np.zeros(DIRECTIONS)
    np.add.at(found, below % DIRECTIONS, (1.0 - part) * distance)
    np.add.at(found, (below + 1) % DIRECTIONS, part * distance)
    return np.asarray(found / distance.sum())
