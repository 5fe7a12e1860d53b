"""The inverse of the limit surface, tabulated: from the direction of a load to the twist that it drives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from push_predictor.models.mechanics.point_friction import twist_of_load
from push_predictor.models.mechanics.pressure import PressureDistribution
from push_predictor.types import Array, IntArray

AZIMUTHS, ELEVATIONS = 144, 49  # of the force's direction, and of the moment from none to a pure one
REFINED = 3  # a smooth surface is solved at every third node and interpolated by cubic splines
SMOOTH_POINTS = 20  # with fewer points of support the surface has flats, and every node is solved


@dataclass(frozen=True, eq=False)
class LoadMap:
    """The tabulated inverse of the limit surface of one pressure distribution, about its centre of pressure.

    nodes (ELEVATIONS, AZIMUTHS + 1, 3): unit twists (vx, vy, w times length) of loads with that azimuth of their force
    and that elevation of moment / length over force. A load with a negative moment has the opposite twist of its
    opposite. centre (2,) m, length m: of the distribution.
    """

    nodes: Array
    centre: Array
    length: float

    @cached_property
    def cells(self) -> Array:
        """Per cell of the table, the bilinear polynomial of each part of the twist, (12, cells)."""
        n = self.nodes
        low, right = n[:-1, :-1], n[:-1, 1:] - n[:-1, :-1]
        up, both = n[1:, :-1] - low, n[1:, 1:] - n[1:, :-1] - right
        return np.ascontiguousarray(np.concatenate([low, right, up, both], axis=2).reshape(-1, 12).T)

    def twist(self, force_x: Array, force_y: Array, moment: Array) -> tuple[Array, Array, Array]:
        """See LimitSurface."""
        return interpolated(self.cells, 0, force_x, force_y, moment)


def load_map(pressure: PressureDistribution) -> LoadMap:
    """Tabulate a distribution; takes some tenths of a second."""
    centre, length = pressure.centre, pressure.length
    centred = PressureDistribution(pressure.points - centre, pressure.shares, pressure.spread)
    every = REFINED if len(pressure.points) >= SMOOTH_POINTS else 1
    return LoadMap(_refined(_solved(centred, length, every), every), centre, length)


def interpolated(
    cells: Array, first: IntArray | int, force_x: Array, force_y: Array, moment: Array
) -> tuple[Array, Array, Array]:
    """Twists (n,) each, from tables in `cells` that begin at the cell `first`; linear in the size of the load."""
    sign = np.where(moment < 0.0, -1.0, 1.0)
    x, y, m = sign * force_x, sign * force_y, sign * moment
    force = np.sqrt(x * x + y * y)
    turn = np.arctan2(y, x) * (AZIMUTHS / (2.0 * np.pi))
    turn += AZIMUTHS * (turn < 0.0)
    rise = np.arctan2(m, force) * ((ELEVATIONS - 1) / (0.5 * np.pi))
    column, row = turn.astype(np.int64), rise.astype(np.int64)
    np.minimum(column, AZIMUTHS - 1, out=column)
    np.minimum(row, ELEVATIONS - 2, out=row)
    right, up = turn - column, rise - row
    cell = cells.take(first + row * AZIMUTHS + column, axis=1)
    size, both = sign * np.sqrt(force * force + m * m), right * up
    vx, vy, spin = (size * (cell[k] + right * cell[k + 3] + up * cell[k + 6] + both * cell[k + 9]) for k in range(3))
    return vx, vy, spin


def _solved(pressure: PressureDistribution, length: float, every: int) -> Array:
    """Unit twists (rows, columns + 1, 3) at every n-th node; the last column is the first."""
    turn = np.arange(0, AZIMUTHS, every) * 2.0 * np.pi / AZIMUTHS
    # one node beyond a pure moment, for the splines: a load of elevation 90 + a and azimuth t is one of 90 - a, t + 180
    rise = np.linspace(0.0, 0.5 * np.pi, (ELEVATIONS - 1) // every + 1) if every == 1 else _coarse(every)
    rise_, turn_ = (grid.ravel() for grid in np.meshgrid(rise, turn, indexing="ij"))
    load = np.column_stack([np.cos(rise_) * np.cos(turn_), np.cos(rise_) * np.sin(turn_), length * np.sin(rise_)])
    twist = twist_of_load(pressure, load) * [1.0, 1.0, length]
    twist = (twist / np.linalg.norm(twist, axis=1, keepdims=True)).reshape(len(rise), len(turn), 3)
    return np.concatenate([twist, twist[:, :1]], axis=1)


def _coarse(every: int) -> Array:
    return np.linspace(0.0, 0.5 * np.pi, round((ELEVATIONS - 1) / every) + 1)


def _refined(twist: Array, every: int) -> Array:
    if every == 1:
        return twist
    turn = np.linspace(0.0, 1.0, twist.shape[1])
    fine = CubicSpline(turn, twist, axis=1, bc_type="periodic")(np.linspace(0.0, 1.0, AZIMUTHS + 1))
    rise = np.linspace(0.0, 1.0, twist.shape[0])
    fine = CubicSpline(rise, fine, axis=0)(np.linspace(0.0, 1.0, ELEVATIONS))
    return np.asarray(fine)
