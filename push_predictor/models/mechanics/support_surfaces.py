"""The limit surfaces of many pushes, each with its own pressure distribution, in one table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.models.mechanics.load_map import LoadMap, interpolated
from push_predictor.models.mechanics.surfaces import PowerSurface
from push_predictor.types import Array, IntArray


@dataclass(frozen=True, eq=False)
class RowSurfaces:
    """Limit surfaces of n pushes: row k blends the tables `low` and `high` (n,) by `share` (n,).

    cells: all tables, one after the other. centre (n, 2) m, length (n,) m.
    """

    cells: Array
    per_table: int
    low: IntArray
    high: IntArray
    share: Array
    centre: Array
    length: Array

    def twist(self, rows: IntArray, x: Array, y: Array, moment: Array) -> tuple[Array, Array, Array]:
        """See LimitSurface, for some of the rows (k,)."""
        one = interpolated(self.cells, self.low[rows] * self.per_table, x, y, moment)
        share = self.share[rows]
        if not share.any():
            return one
        other = interpolated(self.cells, self.high[rows] * self.per_table, x, y, moment)
        vx, vy, spin = (a + share * (b - a) for a, b in zip(one, other, strict=True))
        return vx, vy, spin


@dataclass(frozen=True, eq=False)
class SameSurface:
    """One approximate limit surface for n pushes."""

    surface: PowerSurface
    centre: Array
    length: Array

    def twist(self, rows: IntArray, x: Array, y: Array, moment: Array) -> tuple[Array, Array, Array]:
        """See LimitSurface."""
        return self.surface.twist(x, y, moment)


def row_surfaces(maps: Sequence[LoadMap], low: IntArray, high: IntArray, share: Array) -> RowSurfaces:
    """Blends of `maps` for n pushes."""
    centre, length = np.array([m.centre for m in maps]), np.array([m.length for m in maps])
    cells = maps[0].cells if len(maps) == 1 else np.concatenate([m.cells for m in maps], axis=1)
    part = share[:, None]
    return RowSurfaces(
        cells,
        maps[0].cells.shape[1],
        low,
        high,
        share,
        (1.0 - part) * centre[low] + part * centre[high],
        (1.0 - share) * length[low] + share * length[high],
    )
