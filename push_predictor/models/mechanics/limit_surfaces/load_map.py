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

"""The inverse of the limit surface, tabulated: from the direction of a load to the twist that it drives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np

from push_predictor.models.mechanics.limit_surfaces.direction_dependence import stretched_arms
from push_predictor.models.mechanics.limit_surfaces.point_friction import power_of_twist, twist_of_load
from push_predictor.models.mechanics.limit_surfaces.surfaces import spread_by_direction
from push_predictor.models.mechanics.pressure import PressureDistribution
from push_predictor.types import Array, IntArray

AZIMUTHS, ELEVATIONS = 144, 49  # of the force's direction, and of the moment from none to a pure one
REFINED = 3  # a smooth surface is solved at every third node and interpolated by cubic splines
SMOOTH_POINTS = 20  # with fewer points of support the surface has flats, and every node is solved
BEYOND = 3  # coarse nodes beyond both ends of the elevation, for the splines
STRETCH_STEP = 0.5  # of the friction's direction dependence: secants across it are right to 7 % of its effect
STRETCH_REFINED = 2  # times fewer nodes for the secants

StretchOf: TypeAlias = tuple[Array, Array] | None  # a, b (n,) of the loads' rows, see direction_dependence


@dataclass(frozen=True, eq=False)
class LoadMap:
    """The tabulated inverse of the limit surface of one pressure distribution, about its centre of pressure.

    nodes (ELEVATIONS, AZIMUTHS + 1, 4): unit twists (vx, vy, w times length) of loads with that azimuth of their force
    and that elevation of moment / length over force, and the size of the load on the surface. A load with a negative
    moment has the opposite twist of its opposite. centre (2,) m, length m, square (3,) m^2 and reach: see LimitSurface.
    centred: the distribution about its centre.
    """

    nodes: Array
    centre: Array
    length: float
    square: Array
    reach: Array
    centred: PressureDistribution

    @cached_property
    def cells(self) -> Array:
        """Per cell of the table, the bilinear polynomial of each part of the twist, (12, cells)."""
        return _polynomials(self.nodes[:, :, :3])

    @cached_property
    def sizes(self) -> Array:
        """Per cell of the table, the bilinear polynomial of the size of the load, (4, cells)."""
        return _polynomials(self.nodes[:, :, 3:])

    @cached_property
    def cell_slopes(self) -> Array:
        """Change of `cells` per unit of a and of b of direction-dependent friction, (2, 12, cells)."""
        return np.stack([_polynomials(slope[:, :, :3]) for slope in self._stretched])

    @cached_property
    def size_slopes(self) -> Array:
        """The same of `sizes`, (2, 4, cells)."""
        return np.stack([_polynomials(slope[:, :, 3:]) for slope in self._stretched])

    @cached_property
    def _stretched(self) -> tuple[Array, Array]:
        """Change of the nodes per unit of a and of b; takes as long as `load_map`.

        Zero for few points of support: the flats and edges of their surfaces move, and a blend would not be convex.
        """
        if _every(self.centred) == 1:
            return np.zeros_like(self.nodes), np.zeros_like(self.nodes)
        every = _every(self.centred) * STRETCH_REFINED

        def nodes(a: float, b: float) -> Array:
            shape = stretched_arms(self.centred, a, b)
            return _refined(_solved(shape, shape.length, every), every)

        h = STRETCH_STEP
        return (nodes(h, 0.0) - nodes(-h, 0.0)) / (2.0 * h), (nodes(0.0, h) - nodes(0.0, -h)) / (2.0 * h)

    def twist(self, force_x: Array, force_y: Array, moment: Array) -> tuple[Array, Array, Array]:
        """See LimitSurface."""
        place = place_of(force_x, force_y, moment)
        return interpolated(self.cells.take(place.cell, axis=1), place)

    def gauge(self, force_x: Array, force_y: Array, moment: Array) -> Array:
        """See LimitSurface."""
        place = place_of(force_x, force_y, moment)
        return interpolated_gauge(self.sizes.take(place.cell, axis=1), place)


def load_map(pressure: PressureDistribution) -> LoadMap:
    """Tabulate a distribution; takes about a tenth of a second."""
    centre, length = pressure.centre, pressure.length
    centred = PressureDistribution(pressure.points - centre, pressure.shares, pressure.spread)
    (x, y), shares = centred.points.T, centred.shares
    square = np.array([shares @ (x * x), shares @ (x * y), shares @ (y * y)])
    square += [pressure.spread**2, 0.0, pressure.spread**2]
    every = _every(centred)
    reach = spread_by_direction(centred.points, shares)
    return LoadMap(_refined(_solved(centred, length, every), every), centre, length, square, reach, centred)


class Place(NamedTuple):
    """Where loads are in a table, (n,) each: their sign and size, their cells, and shares of the way across a cell."""

    sign: Array
    size: Array
    cell: IntArray
    right: Array
    up: Array


def interpolated(part: Array, place: Place) -> tuple[Array, Array, Array]:
    """Twists (n,) each, from the polynomials (12, n) of their cells; linear in the size of the load."""
    sign, size, _, right, up = place
    both, size = right * up, sign * size
    vx, vy, spin = (size * (part[k] + right * part[k + 3] + up * part[k + 6] + both * part[k + 9]) for k in range(3))
    return vx, vy, spin


def interpolated_gauge(part: Array, place: Place) -> Array:
    """Sizes (n,) of loads in units of the load on the limit surface in the same direction; part (4, n)."""
    _, size, _, right, up = place
    return np.asarray(size / (part[0] + right * part[1] + up * part[2] + right * up * part[3]))


def place_of(force_x: Array, force_y: Array, moment: Array) -> Place:
    """Find loads (n,) in a table; it is the same place in all tables."""
    sign = np.where(moment < 0.0, -1.0, 1.0)
    x, y, m = sign * force_x, sign * force_y, sign * moment
    force = np.sqrt(x * x + y * y)
    turn = np.arctan2(y, x) * (AZIMUTHS / (2.0 * np.pi))
    turn += AZIMUTHS * (turn < 0.0)
    rise = np.arctan2(m, force) * ((ELEVATIONS - 1) / (0.5 * np.pi))
    column, row = turn.astype(np.int64), rise.astype(np.int64)
    np.minimum(column, AZIMUTHS - 1, out=column)
    np.minimum(row, ELEVATIONS - 2, out=row)
    return Place(sign, np.sqrt(force * force + m * m), row * AZIMUTHS + column, turn - column, rise - row)


def _every(pressure: PressureDistribution) -> int:
    return REFINED if len(pressure.points) >= SMOOTH_POINTS else 1


def _polynomials(nodes: Array) -> Array:
    low, right = nodes[:-1, :-1], nodes[:-1, 1:] - nodes[:-1, :-1]
    up, both = nodes[1:, :-1] - low, nodes[1:, 1:] - nodes[1:, :-1] - right
    parts = np.concatenate([low, right, up, both], axis=2)
    return np.ascontiguousarray(parts.reshape(-1, parts.shape[2]).T)


def _solved(pressure: PressureDistribution, length: float, every: int) -> Array:
    """Unit twists and sizes of loads (rows, columns + 1, 4) at every n-th node; the last column is the first."""
    turn = np.arange(0, AZIMUTHS, every) * 2.0 * np.pi / AZIMUTHS
    rise = np.linspace(0.0, 0.5 * np.pi, (ELEVATIONS - 1) // every + 1)
    rise_, turn_ = (grid.ravel() for grid in np.meshgrid(rise, turn, indexing="ij"))
    load = np.column_stack([np.cos(rise_) * np.cos(turn_), np.cos(rise_) * np.sin(turn_), np.sin(rise_)])
    twist = twist_of_load(pressure, load * [1.0, 1.0, length])
    size = power_of_twist(pressure, twist)
    twist = twist * [1.0, 1.0, length]
    size = size / np.sum(load * twist, axis=1)
    unit = twist / np.linalg.norm(twist, axis=1, keepdims=True)
    nodes = np.column_stack([unit, size]).reshape(len(rise), len(turn), 4)
    return np.concatenate([nodes, nodes[:, :1]], axis=1)


def _refined(nodes: Array, every: int) -> Array:
    """All nodes, by cubic splines over azimuth and elevation."""
    if every == 1:
        return nodes
    from scipy.interpolate import CubicSpline  # its import takes 0.2 s, which no start of a node needs

    turn = np.linspace(0.0, 1.0, nodes.shape[1])
    fine = CubicSpline(turn, nodes, axis=1, bc_type="periodic")(np.linspace(0.0, 1.0, AZIMUTHS + 1))
    around = fine[:, (np.arange(AZIMUTHS + 1) + AZIMUTHS // 2) % AZIMUTHS]
    below = around[BEYOND:0:-1] * [-1.0, -1.0, -1.0, 1.0]  # elevation -a is the opposite of a, half a turn on
    beyond = around[-2 : -BEYOND - 2 : -1]  # elevation 90 + a is 90 - a, half a turn on
    rise = np.arange(-BEYOND, len(nodes) + BEYOND) / (len(nodes) - 1)
    spline = CubicSpline(rise, np.concatenate([below, fine, beyond]), axis=0)
    return np.asarray(spline(np.linspace(0.0, 1.0, ELEVATIONS)))
