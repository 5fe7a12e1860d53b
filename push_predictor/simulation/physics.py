"""What acts on pushed sliders: masses, the grip of the table on each support point, friction at the rod.

All of it is explicit per push, and changes with the place on the table and with the way of the tip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.outline import Outline
from push_predictor.simulation.scatter import Scatter
from push_predictor.simulation.surface import FrictionField
from push_predictor.types import Array

GRAVITY = 9.81  # m/s^2


@dataclass(frozen=True, eq=False)
class Physics:
    """What moves n sliders on k support points.

    radius: of the rod, m. mass (n,) kg, inertia (n,) kg m^2, support (k, 2) m in the body frame, shares (n, k) of the
    weight, contact_friction (n,), surface: friction coefficients of the table. pressure (k wide) and rubbing (1 wide):
    deviations of the logarithms of shares and contact friction along the way.
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

    def grip(self, x: Array, y: Array, way: Array) -> Array:
        """Coulomb friction (n, k) in N on support points at world x, y (n, k) m, the tips having gone way (n,) m."""
        load = self.shares * np.exp(self.pressure.at(way))
        load *= (self.mass * GRAVITY / np.sum(load, axis=1))[:, None]
        return np.asarray(load * self.surface.at(x, y))

    def friction_at_rod(self, way: Array) -> Array:
        """Contact friction coefficients (n,) when the tips have gone way (n,) m."""
        return np.asarray(self.contact_friction * np.exp(self.rubbing.at(way)[:, 0]))

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
        )
