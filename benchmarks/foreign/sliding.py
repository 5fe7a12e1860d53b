# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Friction of the slider's base on the table: patches that each rub against their own sliding velocity."""

from __future__ import annotations

import numpy as np

from benchmarks.foreign.conditions import Conditions
from benchmarks.foreign.rig import Rig
from benchmarks.support.plane import Array


def patch_moments(patches: Array) -> Array:
    """Columns 1, x, y, x^2, x y, y^2 of the patches."""
    x, y = patches.T
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def base_friction(rig: Rig, moments: Array, conditions: Conditions, twist: Array) -> tuple[Array, Array, Array]:
    """Friction wrench on the slider for body twists, and two parts of its negated derivative.

    The first part alone is positive definite and always safe for a step; the second part, subtracted from it,
    makes the derivative exact but for the weak dependence of the coefficient on speed.
    """
    table, (x, y) = rig.table, rig.patches.T
    velocity_x = twist[:, :1] - twist[:, 2:] * y
    velocity_y = twist[:, 1:2] + twist[:, 2:] * x
    squared = velocity_x**2 + velocity_y**2 + table.creep**2
    speed = np.sqrt(squared)
    rate = 1 + table.rise / (1 + squared / table.fade**2) + table.slope * speed
    gain = (table.coefficient * rig.weight * conditions.table_friction)[:, None] * conditions.load * rate / speed
    secant = _assemble(gain @ moments, conditions.tensor)
    wrench = -np.einsum("nij,nj->ni", secant, twist)
    curvature = gain / squared
    plain = np.stack([velocity_x, velocity_y, x * velocity_y - y * velocity_x], axis=1)
    pulled = plain if conditions.tensor is None else _pulled(plain, conditions.tensor, rig.patches)
    return wrench, secant, (pulled * curvature[:, None, :]) @ plain.transpose(0, 2, 1)


def _pulled(plain: Array, tensor: Array, patches: Array) -> Array:
    """Patch velocities after the friction tensor, with their moment about the centre."""
    force = np.einsum("nij,njp->nip", tensor, plain[:, :2])
    moment = patches[:, 0] * force[:, 1] - patches[:, 1] * force[:, 0]
    return np.concatenate([force, moment[:, None, :]], axis=1)


def _assemble(sums: Array, tensor: Array | None) -> Array:
    """Sum over patches of J' A J with J = [[1, 0, -y], [0, 1, x]] from the weighted moments."""
    one, x, y, xx, xy, yy = sums.T
    if tensor is None:
        zero = np.zeros_like(one)
        rows = [[one, zero, -y], [zero, one, x], [-y, x, xx + yy]]
    else:
        (a, b), (c, d) = np.moveaxis(tensor, 0, -1)
        rows = [
            [a * one, b * one, b * x - a * y],
            [c * one, d * one, d * x - c * y],
            [c * x - a * y, d * x - b * y, d * xx - (b + c) * xy + a * yy],
        ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
