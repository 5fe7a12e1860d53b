"""Limit surfaces: from the direction of a load to a twist. The exact one of a pressure distribution is in load_map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from push_predictor.types import Array


class LimitSurface(Protocol):
    """A limit surface about a centre (2,) in m, body frame, with a length c in m by which moments are divided."""

    @property
    def centre(self) -> Array:
        """Centre of friction (2,), m, body frame."""

    @property
    def length(self) -> float:
        """Length c, m: maximum moment over maximum force, or near it."""

    def twist(self, force_x: Array, force_y: Array, moment: Array) -> tuple[Array, Array, Array]:
        """Twist (vx, vy, w times c) up to a positive factor, of a force and a moment about the centre over c."""


@dataclass(frozen=True, eq=False)
class PowerSurface:
    """The cheap approximation (f / fmax)^p + (m / mmax)^p = 1; p = 2 is the ellipsoid of Lynch et al. (1992)."""

    centre: Array
    length: float
    power: float = 2.0

    def twist(self, force_x: Array, force_y: Array, moment: Array) -> tuple[Array, Array, Array]:
        """See LimitSurface."""
        if self.power == 2.0:
            return force_x, force_y, moment
        force = np.sqrt(force_x**2 + force_y**2)
        scale = force ** (self.power - 2.0) if self.power >= 2.0 else np.maximum(force, 1e-12) ** (self.power - 2.0)
        return scale * force_x, scale * force_y, np.abs(moment) ** (self.power - 1.0) * np.sign(moment)
