# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The force of each window on the limit surface: its load, its direction, and the effect of a sensor bias on both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

FORCES = ("normal_force", "tangential_force")


@dataclass(frozen=True, eq=False)
class Load:
    """Per window: log load on the limit surface, direction (rad, from the inward normal), and predicted direction.

    bias (n, 2, 2): change of load and direction per N of sensor bias in the world.
    """

    size: Array
    direction: Array
    predicted: Array
    bias: Array


def loads(table: PushTable, mechanics: FittedMechanics) -> Load:
    """Load, direction and their sensitivity to a bias, for windows with both forces."""
    normal_force, left_force = (table.covariates[name] for name in FORCES)
    velocity, contact, angle = table.inputs.T
    normal = mechanics.outline.inward_normal(contact)
    left = np.column_stack([-normal[:, 1], normal[:, 0]])
    arm = (mechanics.outline.point(contact) - mechanics.ellipsoid.centre) / mechanics.ellipsoid.length
    p = arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0]
    q = arm[:, 0] * left[:, 1] - arm[:, 1] * left[:, 0]
    moment = p * normal_force + q * left_force
    square = normal_force**2 + left_force**2 + moment**2
    along, across = velocity * np.cos(angle), velocity * np.sin(angle)
    direction = _force_direction(p, q, along, across, mechanics.value("contact_friction"))
    by_load = np.column_stack([normal_force + p * moment, left_force + q * moment]) / square[:, None]
    by_turn = np.column_stack([-left_force, normal_force]) / (normal_force**2 + left_force**2)[:, None]
    axes = _world_axes(table, angle)
    bias = -np.stack([np.einsum("nk,nkw->nw", by, axes) for by in (by_load, by_turn)], axis=1)
    return Load(0.5 * np.log(square), np.arctan2(left_force, normal_force), direction, bias)


def _force_direction(p: Array, q: Array, along: Array, across: Array, friction: float) -> Array:
    """Angle (n,) rad of the contact force from the inward normal, on the ellipsoid of Lynch et al. (1992).

    p, q (n,): moment arms over the length of unit forces along the normal and its left; along, across (n,): the
    pusher's velocity in that basis. A contact that sticks moves with the pusher; beyond an edge of the friction cone it
    slips, with the force of that edge.
    """
    push = (1.0 + q * q) * along - p * q * across
    rub = (1.0 + p * p) * across - p * q * along
    edge = np.arctan(friction)
    return np.clip(np.arctan2(rub, push), -edge, edge)


def _world_axes(table: PushTable, angle: Array) -> Array:
    """Inward normal and its left in the world (n, 2, 2), as rows; zero if no heading was recorded."""
    heading = table.covariates.get("push_heading")
    if heading is None:
        return np.zeros((len(table), 2, 2))
    normal = rotate(np.array([[1.0, 0.0]]), heading - angle)
    return np.stack([normal, np.column_stack([-normal[:, 1], normal[:, 0]])], axis=1)


def inputs_of(table: PushTable, mechanics: FittedMechanics, most: int) -> Array:
    """A basis (n, m) of the model's inputs with at most that many columns, for tables of few pushes."""
    velocity, contact, angle = table.inputs.T
    turn = 2.0 * np.pi * contact
    normal = mechanics.outline.inward_normal(contact)
    arm = mechanics.outline.point(contact) / mechanics.ellipsoid.length
    lever = arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0]
    columns = [
        np.ones_like(turn),
        lever**2,
        velocity,
        np.cos(turn),
        np.sin(turn),
        angle**2,
        lever * angle,
        angle,
        lever,
    ]
    columns += [np.cos(2.0 * turn), np.sin(2.0 * turn), angle**3, lever * angle**2, lever**2 * angle, lever**3]
    columns += [np.cos(4.0 * turn), np.sin(4.0 * turn)]
    return np.column_stack(columns[:most])
