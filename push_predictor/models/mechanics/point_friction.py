# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Friction of a sliding body as the sum over its points of support (Goyal, Ruina and Papadopoulos 1991).

A point that slides at velocity u resists with its share of the load along u / |u|. The power of a twist is a norm; the
load of a twist is its gradient, and the limit surface is the set of all loads. Units: forces of the total friction
force, moments of that times m. Where a point stands for a small area, |u| is the root mean square speed there.
"""

from __future__ import annotations

import numpy as np

from push_predictor.models.mechanics.pressure import PressureDistribution
from push_predictor.types import Array

POINT_SPREAD = 3e-3  # of c, at least: a twist about a single point of support then has one load, not a disc of them
NEWTON_STEPS = 60
HALVINGS = 30
CONVERGED = 1e-9
ROUNDING = 1e-14  # of the squared power: next to the minimum, steps change the function by less than this


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
