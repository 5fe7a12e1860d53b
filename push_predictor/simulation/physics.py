# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The forces on pushed sliders: weight, friction at each support point, friction at the rod, and their noise.

All are explicit per push. They change with the position on the table and with the distance travelled by the tip.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from push_predictor.geometry.outline import Outline, Projection
from push_predictor.simulation.changes import PLAIN, Changes, Conditions, Moment
from push_predictor.simulation.surface import FrictionField
from push_predictor.types import Array

GRAVITY = 9.81  # m/s^2
KNOT_SPACING = 0.004  # m travelled by the tip between two independent draws
PERSISTENT_SHARE = 0.2  # of the variance: stays the same for a whole push


@dataclass(frozen=True, eq=False)
class PushNoise:
    """Deviations of n pushes.

    persistent (n, k): constant over each push; knots (n, m, k): one every KNOT_SPACING metres.
    """

    persistent: Array
    knots: Array

    def at(self, travelled: Array) -> Array:
        """Deviations (n, k) after the tips travelled (n,) m.

        Their variance is the same between knots as at knots.
        """
        position = np.minimum(np.maximum(travelled / KNOT_SPACING, 0.0), self.knots.shape[1] - 1.001)
        index = position.astype(np.intp)
        phase = (np.pi / 2.0) * (position - index)[:, None]
        rows = np.arange(len(travelled))
        changing = np.cos(phase) * self.knots[rows, index] + np.sin(phase) * self.knots[rows, index + 1]
        return np.asarray(self.persistent + changing)

    def take(self, rows: np.ndarray) -> PushNoise:
        """The given pushes."""
        return PushNoise(self.persistent[rows], self.knots[rows])


def knot_count(length: float) -> int:
    """Number of knots for a path of `length` m."""
    return int(np.ceil(length / KNOT_SPACING)) + 2


def noise_from_draws(draws: Array) -> PushNoise:
    """Noise with the variance of independent draws (n, m + 1, k).

    The first draw is persistent, the others are the knots.
    """
    return PushNoise(np.sqrt(PERSISTENT_SHARE) * draws[:, 0], np.sqrt(1.0 - PERSISTENT_SHARE) * draws[:, 1:])


@dataclass(frozen=True, eq=False)
class ActingForces:
    """Friction and forces on n sliders at an instant.

    grip (n, k) N, friction (n,) at the rod; grain (n, 2), viscosity (n,) N s/m and pull (n, 3) N, N m as in Changes.
    """

    grip: Array
    friction: Array
    grain: Array | None = None
    viscosity: Array | None = None
    pull: Array | None = None


@dataclass(frozen=True, eq=False)
class Physics:
    """The mechanical parameters of n sliders on k support points.

    radius: of the rod, m. mass (n,) kg, inertia (n,) kg m^2, support (k, 2) m in the body frame, shares (n, k) of the
    weight, contact_friction (n,), surface: friction coefficients of the table. load_noise (k wide) and contact_noise
    (1 wide): deviations of the logarithms of the shares and of the contact friction along the push. changes: effects
    in addition to these, under the conditions of the pushes.
    """

    outline: Outline
    radius: float
    mass: Array
    inertia: Array
    support: Array
    shares: Array
    contact_friction: Array
    surface: FrictionField
    load_noise: PushNoise
    contact_noise: PushNoise
    changes: Changes = PLAIN
    conditions: Conditions = field(default_factory=lambda: Conditions(np.zeros(0, dtype=np.int64)))

    @cached_property
    def inertias(self) -> Array:
        """Mass (twice) and moment of inertia (n, 3) of each slider."""
        return np.stack([self.mass, self.mass, self.inertia], axis=1)

    def acting(
        self, pose: Array, velocity: Array, nearest: Projection, travelled: Array, points: tuple[Array, Array]
    ) -> ActingForces:
        """Friction and forces at an instant.

        nearest: the tips on the outline, points: world x, y (n, k) of the support, m; the others as in Moment.
        """
        changes, moment = self.changes, Moment(self.conditions, pose, velocity, nearest.contact, travelled)
        load = self.load_noise.at(travelled)
        grip = self._grip(load if changes.load is None else load + changes.load(moment), *points)
        friction = self.contact_friction * np.exp(self.contact_noise.at(travelled)[:, 0])
        if changes.contact_friction is not None:
            friction = np.maximum(friction + changes.contact_friction(moment), 0.0)
        return ActingForces(
            grip if changes.grip is None else grip * changes.grip(moment)[:, None],
            friction,
            None if changes.grain is None else changes.grain(moment),
            None if changes.viscosity is None else changes.viscosity(moment),
            None if changes.pull is None else changes.pull(moment),
        )

    def _grip(self, log_load: Array, x: Array, y: Array) -> Array:
        load = self.shares * np.exp(log_load)
        load *= (self.mass * GRAVITY / np.sum(load, axis=1))[:, None]
        return np.asarray(load * self.surface.at(x, y))

    def take(self, rows: np.ndarray) -> Physics:
        """The given pushes."""
        return replace(
            self,
            mass=self.mass[rows],
            inertia=self.inertia[rows],
            shares=self.shares[rows],
            contact_friction=self.contact_friction[rows],
            load_noise=self.load_noise.take(rows),
            contact_noise=self.contact_noise.take(rows),
            conditions=self.conditions.take(rows) if len(self.conditions.row) else self.conditions,
        )
