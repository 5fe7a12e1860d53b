"""What acts on pushed sliders: masses, the grip of the table on each support point, friction at the rod.

All of it is explicit per push, and changes with the place on the table and with the way of the tip.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from push_predictor.geometry.outline import Outline
from push_predictor.simulation.changes import PLAIN, Changes, Conditions, Moment
from push_predictor.simulation.noise import Scatter
from push_predictor.simulation.surface import FrictionField
from push_predictor.types import Array

GRAVITY = 9.81  # m/s^2


@dataclass(frozen=True, eq=False)
class Acting:
    """What acts on n sliders at an instant.

    grip (n, k) N, friction (n,) at the rod; grain (n, 2), viscosity (n,) N s/m and pull (n, 3) N, N m as in Changes.
    """

    grip: Array
    friction: Array
    grain: Array | None = None
    viscosity: Array | None = None
    pull: Array | None = None


@dataclass(frozen=True, eq=False)
class Physics:
    """What moves n sliders on k support points.

    radius: of the rod, m. mass (n,) kg, inertia (n,) kg m^2, support (k, 2) m in the body frame, shares (n, k) of the
    weight, contact_friction (n,), surface: friction coefficients of the table. pressure (k wide) and rubbing (1 wide):
    deviations of the logarithms of shares and contact friction along the way. changes: what acts beside all this, under
    the conditions of the pushes.
    """

    outline: Outline
    radius: float
    mass: Array
    inertia: Array
    support: Array
    shares: Array
    contact_friction: Array
    surface: FrictionField
    pressure: Scatter
    rubbing: Scatter
    changes: Changes = PLAIN
    conditions: Conditions = field(default_factory=lambda: Conditions(np.zeros(0, dtype=np.int64)))

    def grip(self, x: Array, y: Array, way: Array) -> Array:
        """Coulomb friction (n, k) in N on support points at world x, y (n, k) m, the tips having gone way (n,) m."""
        return self._gripped(self.pressure.at(way), x, y)

    def friction_at_rod(self, way: Array) -> Array:
        """Contact friction coefficients (n,) when the tips have gone way (n,) m."""
        return np.asarray(self.contact_friction * np.exp(self.rubbing.at(way)[:, 0]))

    def acting(self, pose: Array, velocity: Array, contact: Array, way: Array, points: tuple[Array, Array]) -> Acting:
        """All that acts at an instant; see Moment for the arguments, points: world x, y (n, k) of the support, m."""
        if self.changes == PLAIN:
            return Acting(self.grip(*points, way), self.friction_at_rod(way))
        changes, moment = self.changes, Moment(self.conditions, pose, velocity, contact, way)
        pressure = self.pressure.at(way)
        grip = self._gripped(pressure if changes.load is None else pressure + changes.load(moment), *points)
        friction = self.friction_at_rod(way)
        return Acting(
            grip if changes.grip is None else grip * changes.grip(moment)[:, None],
            friction if changes.contact_friction is None else _added(friction, changes.contact_friction(moment)),
            None if changes.grain is None else changes.grain(moment),
            None if changes.viscosity is None else changes.viscosity(moment),
            None if changes.pull is None else changes.pull(moment),
        )

    def _gripped(self, pressure: Array, x: Array, y: Array) -> Array:
        load = self.shares * np.exp(pressure)
        load *= (self.mass * GRAVITY / np.sum(load, axis=1))[:, None]
        return np.asarray(load * self.surface.at(x, y))

    def take(self, rows: np.ndarray) -> Physics:
        """The given pushes."""
        return Physics(
            self.outline,
            self.radius,
            self.mass[rows],
            self.inertia[rows],
            self.support,
            self.shares[rows],
            self.contact_friction[rows],
            self.surface,
            self.pressure.take(rows),
            self.rubbing.take(rows),
            self.changes,
            self.conditions.take(rows) if len(self.conditions.row) else self.conditions,
        )


def _added(friction: Array, change: Array) -> Array:
    return np.asarray(np.maximum(friction + change, 0.0))
