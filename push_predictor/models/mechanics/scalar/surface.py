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

"""Limit surfaces in plain numbers: the same mathematics as load_map, surfaces and loaded_surface, for single pushes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from math import atan2, pi, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np

from push_predictor.models.mechanics.limit_surfaces.direction_dependence import COS, MOST_STRETCH, SIN
from push_predictor.models.mechanics.limit_surfaces.load_map import AZIMUTHS, ELEVATIONS
from push_predictor.models.mechanics.limit_surfaces.loaded_surface import PULL_ROUNDS, SMALLEST_MARGIN
from push_predictor.models.mechanics.limit_surfaces.support_surfaces import (
    PushSurfaces,
    RowSurfaces,
    SameSurface,
)
from push_predictor.models.mechanics.limit_surfaces.surfaces import PowerSurface
from push_predictor.models.mechanics.motion.contact_solution import ROOT_TOLERANCE
from push_predictor.types import Array

EXACT = 1e-13  # rad: on an ellipsoid the velocity is linear in the force, so the second secant is exact

Three: TypeAlias = tuple[float, float, float]
Twist: TypeAlias = Callable[[float, float, float], Three]  # of a load (force x, y, moment over length)
Gauge: TypeAlias = Callable[[float, float, float], float]
Shape: TypeAlias = Callable[[float, float], tuple[Twist, Gauge]]  # of a surface by a, b, see direction_dependence
Cells: TypeAlias = list[tuple[float, ...]]  # the polynomials of a table


@dataclass(frozen=True, eq=False)
class ScalarSurface:
    """One limit surface: see LimitSurface. shape: the twist and gauge under direction-dependent friction.

    tolerance: rad, of a contact that sticks.
    """

    centre: tuple[float, float]
    length: float
    square: Three
    reach: Array
    twist: Twist
    gauge: Gauge
    shape: Shape
    tolerance: float = ROOT_TOLERANCE


class Stretch(NamedTuple):
    """The root of the direction-dependent friction: see direction_dependence.Root."""

    a: float
    b: float
    xx: float
    xy: float
    yy: float
    turn: float


def scalar_surface(surfaces: PushSurfaces) -> ScalarSurface:
    """The surface of the first push."""
    shape, tolerance = _shape_of(surfaces)
    twist, gauge = shape(0.0, 0.0)
    of_rows = surfaces.of_rows
    x, y = of_rows.centre[0].tolist()
    xx, xy, yy = of_rows.square[0].tolist()
    length = float(of_rows.length[0])
    return ScalarSurface((x, y), length, (xx, xy, yy), of_rows.reach[0], twist, gauge, shape, tolerance)


def is_ellipsoid(twist: Twist) -> bool:
    """Whether the velocity is the load itself, in the units of the surface."""
    return twist is _ellipsoid


def root_of_stretch(a: float, b: float, reach: Array) -> Stretch:
    """See direction_dependence."""
    factor = min(1.0, MOST_STRETCH / max(sqrt(a * a + b * b), MOST_STRETCH))
    a, b = a * factor, b * factor
    determinant = sqrt(1.0 - a * a - b * b)
    trace = sqrt(2.0 + 2.0 * determinant)
    turn = determinant / float(reach @ np.sqrt(1.0 + a * COS + b * SIN))
    return Stretch(a, b, (1.0 + a + determinant) / trace, b / trace, (1.0 - a + determinant) / trace, turn)


def loaded(surface: ScalarSurface, stretch: Stretch | None, pull: Three | None, height: float) -> Twist:
    """The twist of the surface under a pusher's load; see LoadedSurface."""
    if stretch is None and pull is None and height == 0.0:
        return surface.twist
    a, b, xx, xy, yy, turn = stretch or Stretch(0.0, 0.0, 1.0, 0.0, 1.0, 1.0)
    twist_of, gauge_of = (surface.twist, surface.gauge) if stretch is None else surface.shape(a, b)
    if pull is not None:
        pull = xx * pull[0] + xy * pull[1], xy * pull[0] + yy * pull[1], turn * pull[2]

    def twist(force_x: float, force_y: float, moment: float) -> Three:
        load = xx * force_x + xy * force_y, xy * force_x + yy * force_y, turn * moment
        factor = 0.0
        if pull is not None:
            factor, load = _with_pull(gauge_of, load, pull)
        elif height:
            factor = 1.0 / gauge_of(*load)
        vx, vy, spin = twist_of(*load)
        vx, vy, spin = xx * vx + xy * vy, xy * vx + yy * vy, turn * spin
        shift = height * factor * spin / surface.length
        return vx + shift * force_y, vy - shift * force_x, spin

    return twist


def _with_pull(gauge: Gauge, pusher: Three, pull: Three) -> tuple[float, Three]:
    x, y, m = pusher
    gx, gy, gm = pull
    given = sqrt(x * x + y * y + m * m)
    x, y, m = x / given, y / given, m / given
    dot, square, radius = x * gx + y * gy + m * gm, gx * gx + gy * gy + gm * gm, 1.0
    for _ in range(PULL_ROUNDS):
        share = -dot + sqrt(max(dot * dot + radius * radius - square, SMALLEST_MARGIN))
        lx, ly, lm = share * x + gx, share * y + gy, share * m + gm
        radius = sqrt(lx * lx + ly * ly + lm * lm) / gauge(lx, ly, lm)
    return share / given, (given * lx, given * ly, given * lm)


def _shape_of(surfaces: PushSurfaces) -> tuple[Shape, float]:
    """The shape of the first push's surface, and the tolerance of a contact that sticks."""
    if isinstance(surfaces, RowSurfaces):
        return _tabulated(surfaces), ROOT_TOLERANCE
    if not isinstance(surfaces, SameSurface):
        raise TypeError(f"{type(surfaces).__name__} has no version in plain numbers")
    if surfaces.surface.power == 2.0:
        return lambda a, b: (_ellipsoid, _norm), EXACT
    same = _of_arrays(surfaces.surface), _gauge_of_arrays(surfaces.surface)
    return lambda a, b: same, ROOT_TOLERANCE


def _tabulated(surfaces: RowSurfaces) -> Shape:
    """The first push's tables, blended; the slopes are prepared when a surface is stretched first."""
    cells, sizes = _cells(surfaces, surfaces.cells), _cells(surfaces, surfaces.sizes)

    @cache
    def slopes() -> tuple[tuple[Cells, Cells], tuple[Cells, Cells]]:
        (ca, cb), (sa, sb) = surfaces.cell_slopes, surfaces.size_slopes
        return (_cells(surfaces, ca), _cells(surfaces, cb)), (_cells(surfaces, sa), _cells(surfaces, sb))

    def shape(a: float, b: float) -> tuple[Twist, Gauge]:
        if a == b == 0.0:
            return _of_cells(cells.__getitem__), _gauge_of_cells(sizes.__getitem__)
        of_cells, of_sizes = slopes()
        return _of_cells(_changed(cells, of_cells, a, b)), _gauge_of_cells(_changed(sizes, of_sizes, a, b))

    return shape


def _changed(cells: Cells, slopes: tuple[Cells, Cells], a: float, b: float) -> Callable[[int], Sequence[float]]:
    by_a, by_b = slopes
    return lambda k: [c + a * p + b * q for c, p, q in zip(cells[k], by_a[k], by_b[k], strict=True)]


def _cells(surfaces: RowSurfaces, tables: Array) -> Cells:
    count, share = surfaces.per_table, float(surfaces.share[0])
    low, high = (tables[:, int(k[0]) * count : (int(k[0]) + 1) * count] for k in (surfaces.low, surfaces.high))
    return [tuple(cell) for cell in ((1.0 - share) * low + share * high).T.tolist()]


def _of_cells(cell: Callable[[int], Sequence[float]]) -> Twist:
    per_turn, per_rise = AZIMUTHS / (2.0 * pi), (ELEVATIONS - 1) / (0.5 * pi)
    last_column, last_row = AZIMUTHS - 1, ELEVATIONS - 2

    def twist(x: float, y: float, m: float) -> Three:
        sign = 1.0
        if m < 0.0:
            sign, x, y, m = -1.0, -x, -y, -m
        force = x * x + y * y
        turn, rise = atan2(y, x) * per_turn, atan2(m, sqrt(force)) * per_rise
        if turn < 0.0:
            turn += AZIMUTHS
        column, row = int(turn), int(rise)
        if column > last_column:
            column = last_column
        if row > last_row:
            row = last_row
        a, b, c, ar, br, cr, au, bu, cu, ab, bb, cb = cell(row * AZIMUTHS + column)
        right, up, size = turn - column, rise - row, sign * sqrt(force + m * m)
        both = right * up
        return (
            size * (a + right * ar + up * au + both * ab),
            size * (b + right * br + up * bu + both * bb),
            size * (c + right * cr + up * cu + both * cb),
        )

    return twist


def _gauge_of_cells(cell: Callable[[int], Sequence[float]]) -> Gauge:
    per_turn, per_rise = AZIMUTHS / (2.0 * pi), (ELEVATIONS - 1) / (0.5 * pi)

    def gauge(x: float, y: float, m: float) -> float:
        if m < 0.0:
            x, y, m = -x, -y, -m
        force = x * x + y * y
        turn, rise = atan2(y, x) * per_turn, atan2(m, sqrt(force)) * per_rise
        turn += AZIMUTHS * (turn < 0.0)
        column, row = min(int(turn), AZIMUTHS - 1), min(int(rise), ELEVATIONS - 2)
        low, along, above, across = cell(row * AZIMUTHS + column)
        right, up = turn - column, rise - row
        return sqrt(force + m * m) / (low + right * along + up * above + right * up * across)

    return gauge


def _ellipsoid(x: float, y: float, m: float) -> Three:
    return x, y, m


def _norm(x: float, y: float, m: float) -> float:
    return sqrt(x * x + y * y + m * m)


def _of_arrays(surface: PowerSurface) -> Twist:
    def twist(x: float, y: float, m: float) -> Three:
        vx, vy, spin = surface.twist(*(np.array([part]) for part in (x, y, m)))
        return float(vx[0]), float(vy[0]), float(spin[0])

    return twist


def _gauge_of_arrays(surface: PowerSurface) -> Gauge:
    def gauge(x: float, y: float, m: float) -> float:
        return float(surface.gauge(*(np.array([part]) for part in (x, y, m)))[0])

    return gauge
