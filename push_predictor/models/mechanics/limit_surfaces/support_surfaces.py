"""The limit surfaces of many pushes, each with its own pressure distribution, in one table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, TypeAlias

import numpy as np

from push_predictor.models.mechanics.limit_surfaces.load_map import (
    LoadMap,
    Place,
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
    """Limit surfaces of n pushes."""

    @property
    def of_rows(self) -> RowQuantities:
        """Quantities of each push."""

    def twist(self, rows: IntArray, x: Array, y: Array, moment: Array) -> Twist:
        """See LimitSurface, for some of the rows (k,)."""

    def gauge(self, rows: IntArray, x: Array, y: Array, moment: Array) -> Array:
        """See LimitSurface, for some of the rows (k,)."""

    def twist_and_gauge(self, rows: IntArray, x: Array, y: Array, moment: Array) -> tuple[Twist, Array]:
        """Both for the same loads."""


@dataclass(frozen=True, eq=False)
class RowSurfaces:
    """Limit surfaces of n pushes: row k blends the tables `low` and `high` (n,) by `share` (n,).

    cells, sizes: those of all tables, one after the other.
    """

    cells: Array
    sizes: Array
    per_table: int
    low: IntArray
    high: IntArray
    share: Array
    of_rows: RowQuantities

    def twist(self, rows: IntArray, x: Array, y: Array, moment: Array) -> Twist:
        """See PushSurfaces."""
        return self._twist(rows, place_of(x, y, moment))

    def gauge(self, rows: IntArray, x: Array, y: Array, moment: Array) -> Array:
        """See PushSurfaces."""
        return self._gauge(rows, place_of(x, y, moment))

    def twist_and_gauge(self, rows: IntArray, x: Array, y: Array, moment: Array) -> tuple[Twist, Array]:
        """See PushSurfaces: the loads are looked up once."""
        place = place_of(x, y, moment)
        return self._twist(rows, place), self._gauge(rows, place)

    def _twist(self, rows: IntArray, place: Place) -> Twist:
        one = interpolated(self.cells, self.low[rows] * self.per_table, place)
        share = self.share[rows]
        if not share.any():
            return one
        other = interpolated(self.cells, self.high[rows] * self.per_table, place)
        vx, vy, spin = (a + share * (b - a) for a, b in zip(one, other, strict=True))
        return vx, vy, spin

    def _gauge(self, rows: IntArray, place: Place) -> Array:
        one = interpolated_gauge(self.sizes, self.low[rows] * self.per_table, place)
        share = self.share[rows]
        if not share.any():
            return one
        other = interpolated_gauge(self.sizes, self.high[rows] * self.per_table, place)
        return np.asarray(one + share * (other - one))


@dataclass(frozen=True, eq=False)
class SameSurface:
    """One approximate limit surface for n pushes."""

    surface: PowerSurface
    of_rows: RowQuantities

    def twist(self, rows: IntArray, x: Array, y: Array, moment: Array) -> Twist:
        """See PushSurfaces."""
        return self.surface.twist(x, y, moment)

    def gauge(self, rows: IntArray, x: Array, y: Array, moment: Array) -> Array:
        """See PushSurfaces."""
        return self.surface.gauge(x, y, moment)

    def twist_and_gauge(self, rows: IntArray, x: Array, y: Array, moment: Array) -> tuple[Twist, Array]:
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

    return RowSurfaces(
        maps[0].cells if len(maps) == 1 else np.concatenate([one.cells for one in maps], axis=1),
        maps[0].sizes if len(maps) == 1 else np.concatenate([one.sizes for one in maps], axis=1),
        maps[0].cells.shape[1],
        low,
        high,
        share,
        RowQuantities(blend("centre"), blend("length"), blend("square"), blend("reach")),
    )
