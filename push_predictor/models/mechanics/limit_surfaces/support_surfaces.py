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

"""The limit surfaces of many pushes, each with its own pressure distribution, in one table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, TypeAlias

import numpy as np

from push_predictor.models.mechanics.limit_surfaces.load_map import (
    LoadMap,
    Place,
    StretchOf,
    interpolated,
    interpolated_gauge,
    place_of,
)
from push_predictor.models.mechanics.limit_surfaces.surfaces import PowerSurface
from push_predictor.types import Array, IntArray

Twist: TypeAlias = tuple[Array, Array, Array]  # vx, vy, w times length, (k,) each, up to a factor


@dataclass(frozen=True, eq=False)
class RowQuantities:
    """Per push: centre (n, 2) m, length (n,) m, square (n, 3) m^2 and reach (n, DIRECTIONS) of its limit surface."""

    centre: Array
    length: Array
    square: Array
    reach: Array

    def spread(self, factor: Array) -> RowQuantities:
        """The same pressures, spread by factors (n,) about their centres: the surface keeps its shape."""
        return replace(self, length=self.length * factor, square=self.square * (factor * factor)[:, None])


class PushSurfaces(Protocol):
    """Limit surfaces of n pushes.

    stretch: a and b (k,) of the direction-dependent friction that gives the surface another shape.
    """

    @property
    def of_rows(self) -> RowQuantities:
        """Quantities of each push."""

    def twist(self, rows: IntArray, x: Array, y: Array, moment: Array, stretch: StretchOf = None) -> Twist:
        """See LimitSurface, for some of the rows (k,)."""

    def gauge(self, rows: IntArray, x: Array, y: Array, moment: Array, stretch: StretchOf = None) -> Array:
        """See LimitSurface, for some of the rows (k,)."""

    def twist_and_gauge(
        self, rows: IntArray, x: Array, y: Array, moment: Array, stretch: StretchOf = None
    ) -> tuple[Twist, Array]:
        """Both for the same loads."""


@dataclass(frozen=True, eq=False)
class RowSurfaces:
    """Limit surfaces of n pushes: row k blends the tables `low` and `high` (n,) of `maps` by `share` (n,)."""

    maps: Sequence[LoadMap]
    low: IntArray
    high: IntArray
    share: Array
    of_rows: RowQuantities

    @cached_property
    def cells(self) -> Array:
        """Those of all tables, one after the other."""
        return _joined([one.cells for one in self.maps])

    @cached_property
    def cell_slopes(self) -> Array:
        """Those of all tables along the last axis, (2, 12, cells)."""
        return _joined([one.cell_slopes for one in self.maps])

    @cached_property
    def sizes(self) -> Array:
        """See `cells`."""
        return _joined([one.sizes for one in self.maps])

    @cached_property
    def size_slopes(self) -> Array:
        """Those of all tables along the last axis, (2, 4, cells)."""
        return _joined([one.size_slopes for one in self.maps])

    @property
    def per_table(self) -> int:
        """Cells of a table."""
        return int(self.maps[0].cells.shape[1])

    def twist(self, rows: IntArray, x: Array, y: Array, moment: Array, stretch: StretchOf = None) -> Twist:
        """See PushSurfaces."""
        return self._twist(rows, place_of(x, y, moment), stretch)

    def gauge(self, rows: IntArray, x: Array, y: Array, moment: Array, stretch: StretchOf = None) -> Array:
        """See PushSurfaces."""
        return self._gauge(rows, place_of(x, y, moment), stretch)

    def twist_and_gauge(
        self, rows: IntArray, x: Array, y: Array, moment: Array, stretch: StretchOf = None
    ) -> tuple[Twist, Array]:
        """See PushSurfaces: the loads are looked up once."""
        place = place_of(x, y, moment)
        return self._twist(rows, place, stretch), self._gauge(rows, place, stretch)

    def _twist(self, rows: IntArray, place: Place, stretch: StretchOf) -> Twist:
        def of(table: IntArray) -> Twist:
            at = table[rows] * self.per_table + place.cell
            part = self.cells.take(at, axis=1)
            return interpolated(part if stretch is None else _stretched(part, self.cell_slopes, at, stretch), place)

        one, share = of(self.low), self.share[rows]
        if not share.any():
            return one
        vx, vy, spin = (a + share * (b - a) for a, b in zip(one, of(self.high), strict=True))
        return vx, vy, spin

    def _gauge(self, rows: IntArray, place: Place, stretch: StretchOf) -> Array:
        def of(table: IntArray) -> Array:
            at = table[rows] * self.per_table + place.cell
            part = self.sizes.take(at, axis=1)
            part = part if stretch is None else _stretched(part, self.size_slopes, at, stretch)
            return interpolated_gauge(part, place)

        one, share = of(self.low), self.share[rows]
        if not share.any():
            return one
        return np.asarray(one + share * (of(self.high) - one))


@dataclass(frozen=True, eq=False)
class SameSurface:
    """One approximate limit surface for n pushes, which keeps its shape under direction-dependent friction."""

    surface: PowerSurface
    of_rows: RowQuantities

    def twist(self, rows: IntArray, x: Array, y: Array, moment: Array, stretch: StretchOf = None) -> Twist:
        """See PushSurfaces."""
        return self.surface.twist(x, y, moment)

    def gauge(self, rows: IntArray, x: Array, y: Array, moment: Array, stretch: StretchOf = None) -> Array:
        """See PushSurfaces."""
        return self.surface.gauge(x, y, moment)

    def twist_and_gauge(
        self, rows: IntArray, x: Array, y: Array, moment: Array, stretch: StretchOf = None
    ) -> tuple[Twist, Array]:
        """See PushSurfaces."""
        return self.twist(rows, x, y, moment), self.gauge(rows, x, y, moment)


def same_surface(surface: PowerSurface, n: int) -> SameSurface:
    """The surface for n pushes."""
    centre, square, reach = (np.tile(values, (n, 1)) for values in (surface.centre, surface.square, surface.reach))
    return SameSurface(surface, RowQuantities(centre, np.full(n, surface.length), square, reach))


def row_surfaces(maps: Sequence[LoadMap], low: IntArray, high: IntArray, share: Array) -> RowSurfaces:
    """Blends of `maps` for n pushes."""

    def blend(name: str) -> Array:
        values = np.array([getattr(one, name) for one in maps])
        part = share.reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray((1.0 - part) * values[low] + part * values[high])

    quantities = RowQuantities(blend("centre"), blend("length"), blend("square"), blend("reach"))
    return RowSurfaces(maps, low, high, share, quantities)


def _joined(tables: Sequence[Array]) -> Array:
    """Tables, one after the other along the cells."""
    return tables[0] if len(tables) == 1 else np.concatenate(tables, axis=-1)


def _stretched(part: Array, slopes: Array, at: IntArray, stretch: tuple[Array, Array]) -> Array:
    """Polynomials (12 or 4, k) of the cells `at`, changed by the stretch."""
    a, b = stretch
    return np.asarray(part + a * slopes[0].take(at, axis=1) + b * slopes[1].take(at, axis=1))
