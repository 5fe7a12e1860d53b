# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The inverse of the limit surface, tabulated: from the direction of a load to the twist that it drives.

The compiled kernel (kernel/surface) interpolates these tables. The friction of a sliding body is a sum over its points
of support (Goyal, Ruina and Papadopoulos 1991): a point that slides at velocity u resists with its share of the load
along u / |u|. The power of a twist is a norm. The load of a twist is its gradient, and the limit surface is the set of
all loads. Units: forces of the total friction force, moments of that times m. Where a point stands for a small area,
|u| is the root mean square speed there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.models.mechanics.pressure import PressureDistribution
from push_predictor.types import Array

AZIMUTHS, ELEVATIONS = 144, 49  # of the force's direction, and of the moment from none to a pure one
DIRECTIONS = 16  # of arms, over half a turn
REFINED = 3  # a smooth surface is solved at every third node and interpolated by cubic splines
SMOOTH_POINTS = 20  # with fewer points of support the surface has flats, and every node is solved
BEYOND = 3  # coarse nodes beyond both ends of the elevation, for the splines
STRETCH_STEP = 0.5  # of the friction's direction dependence: secants across it are right to 7 % of its effect
STRETCH_REFINED = 2  # times fewer nodes for the secants
POINT_SPREAD = 3e-3  # of c, at least: a twist about a single point of support then has one load, not a disc of them
NEWTON_STEPS = 60
HALVINGS = 30
CONVERGED = 1e-9
ROUNDING = 1e-14  # of the squared power: next to the minimum, steps change the function by less than this


@dataclass(frozen=True, eq=False)
class LoadMap:
    """The tabulated inverse of the limit surface of one pressure distribution, about its centre of pressure.

    nodes (ELEVATIONS, AZIMUTHS + 1, 4): unit twists (vx, vy, w times length) of loads with that azimuth of their force
    and that elevation of moment / length over force, and the size of the load on the surface. A load with a negative
    moment has the opposite twist of its opposite. centred: the distribution about its centre.
    quantities (22,): centre x, y (m), length c = mmax / fmax (m), mean squares xx, xy, yy (m^2) of the pressure, and
    its reach; see `reach`.
    """

    nodes: Array
    centred: PressureDistribution
    quantities: Array

    @cached_property
    def slopes(self) -> Array:
        """Change of `nodes` per unit of a, then of b, of direction-dependent friction, (..., 8); see kernel/surface.

        Takes as long as `load_map`. Zero for few points of support: the flats and edges of their surfaces move, and a
        blend would not be convex.
        """
        if _every(self.centred) == 1:
            return np.zeros((*self.nodes.shape[:2], 8))
        every, h = _every(self.centred) * STRETCH_REFINED, STRETCH_STEP

        def nodes(a: float, b: float) -> Array:
            shape = stretched_arms(self.centred, a, b)
            return _refined(_solved(shape, shape.length, every), every)

        by_a, by_b = nodes(h, 0.0) - nodes(-h, 0.0), nodes(0.0, h) - nodes(0.0, -h)
        return np.concatenate([by_a, by_b], axis=2) / (2.0 * h)


def load_map(pressure: PressureDistribution) -> LoadMap:
    """Tabulate a distribution; takes about a tenth of a second."""
    centre, length = pressure.centre, pressure.length
    centred = PressureDistribution(pressure.points - centre, pressure.shares, pressure.spread)
    (x, y), shares = centred.points.T, centred.shares
    square = np.array([shares @ (x * x), shares @ (x * y), shares @ (y * y)])
    square += [pressure.spread**2, 0.0, pressure.spread**2]
    every = _every(centred)
    nodes = _refined(_solved(centred, length, every), every)
    return LoadMap(nodes, centred, np.concatenate([centre, [length], square, reach(centred)]))


def reach(centred: PressureDistribution) -> Array:
    """Shares (DIRECTIONS,) of the mean distance of the load from the origin, by direction over half a turn.

    Direction k is k pi / DIRECTIONS; an arm between two directions counts for both in proportion.
    """
    points = centred.points
    distance = centred.shares * np.linalg.norm(points, axis=1)
    place = np.arctan2(points[:, 1], points[:, 0]) % np.pi * (DIRECTIONS / np.pi)
    below = place.astype(np.int64)
    part, found = place - below, np.zeros(DIRECTIONS)
    np.add.at(found, below % DIRECTIONS, (1.0 - part) * distance)
    np.add.at(found, (below + 1) % DIRECTIONS, part * distance)
    return np.asarray(found / distance.sum())


def stretched_arms(centred: PressureDistribution, a: float, b: float) -> PressureDistribution:
    """The distribution about its centre with the arms R r of direction-dependent friction; see kernel/surface.

    The size of the arms does not change the shape of a surface.
    """
    determinant = np.sqrt(1.0 - a * a - b * b)
    root = np.array([[1.0 + a + determinant, b], [b, 1.0 - a + determinant]]) / np.sqrt(2.0 + 2.0 * determinant)
    return PressureDistribution(centred.points @ root, centred.shares, centred.spread)


def _every(pressure: PressureDistribution) -> int:
    return REFINED if len(pressure.points) >= SMOOTH_POINTS else 1


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


def power_of_twist(pressure: PressureDistribution, twist: Array) -> Array:
    """Power (n,) in m/s of the friction against a twist (n, 3), over the friction force; as smooth as twist_of_load."""
    spread = max(pressure.spread, POINT_SPREAD * pressure.length)
    return np.asarray(_speeds(pressure.points, spread, twist)[2] @ pressure.shares)


def twist_of_load(pressure: PressureDistribution, load: Array) -> Array:
    """Twist (n, 3), up to a positive factor, whose load is parallel to `load` (n, 3; no row zero).

    Minimises D(t)^2 / 2 - l t, where D is the power: a strictly convex function, at whose minimum D(t) grad D(t) = l.
    Newton's method with halved steps.
    """
    length = pressure.length
    unit = load * [1.0, 1.0, 1.0 / length]
    unit = unit / np.linalg.norm(unit, axis=1, keepdims=True)
    spread = max(pressure.spread / length, POINT_SPREAD)
    twist = _minimum(pressure.points / length, pressure.shares, spread, unit)
    return np.asarray(twist * [1.0, 1.0, 1.0 / length])


def _minimum(points: Array, shares: Array, spread: float, load: Array) -> Array:
    twist, rows = load.copy(), np.arange(len(load))
    for _ in range(NEWTON_STEPS):
        t, wanted = twist[rows], load[rows]
        power, slope, bend = _bends(points, shares, spread, t)
        gradient = power[:, None] * slope - wanted
        hessian = slope[:, :, None] * slope[:, None, :] + power[:, None, None] * bend
        step = -np.linalg.solve(hessian, gradient[:, :, None])[:, :, 0]
        descent = np.sum(step * gradient, axis=1)
        moving = -descent > CONVERGED**2
        if not moving.any():
            break
        value = (0.5 + ROUNDING) * power**2 - np.sum(wanted * t, axis=1)
        rows, t, step = rows[moving], t[moving], step[moving]
        share = np.ones(len(rows))
        for _ in range(HALVINGS):
            trial = t + share[:, None] * step
            power = _speeds(points, spread, trial)[2] @ shares
            worse = 0.5 * power**2 - np.sum(load[rows] * trial, axis=1) > value[moving] + 1e-4 * share * descent[moving]
            if not worse.any():
                break
            share = np.where(worse, 0.5 * share, share)
        twist[rows] = t + share[:, None] * step
    return twist


def _speeds(points: Array, spread: float, twist: Array) -> tuple[Array, Array, Array]:
    """Velocity x, y and root mean square speed (n, k) of the points' areas."""
    x, y = points.T
    ux, uy = twist[:, :1] - twist[:, 2:] * y, twist[:, 1:2] + twist[:, 2:] * x
    return ux, uy, np.sqrt(ux * ux + uy * uy + 2.0 * (spread * twist[:, 2:]) ** 2 + np.finfo(np.float64).tiny)


def _bends(points: Array, shares: Array, spread: float, twist: Array) -> tuple[Array, Array, Array]:
    """Power D (n,), its gradient (n, 3) and Hessian (n, 3, 3)."""
    x, y = points.T
    ux, uy, speed = _speeds(points, spread, twist)
    weight, area = shares / speed, 2.0 * spread**2
    mass, zero = weight.sum(axis=1), np.zeros(len(twist))
    wx, wy, wr = weight @ x, weight @ y, weight @ (x * x + y * y) + mass * area
    first = np.stack([mass, zero, -wy, zero, mass, wx, -wy, wx, wr], axis=1).reshape(-1, 3, 3)
    turn = x * uy - y * ux + area * twist[:, 2:]
    root = np.sqrt(shares / speed**3)
    parts = np.stack([root * ux, root * uy, root * turn], axis=1)
    gradient = np.stack([(weight * ux).sum(axis=1), (weight * uy).sum(axis=1), (weight * turn).sum(axis=1)], axis=1)
    return speed @ shares, gradient, first - parts @ parts.transpose(0, 2, 1)
