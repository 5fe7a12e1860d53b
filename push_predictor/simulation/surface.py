# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Surfaces: Coulomb friction that varies over the table, fixed by a seed.

The coefficients are representative of the four materials of the MIT push data set. They are not measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from push_predictor.errors import RigError
from push_predictor.types import Array

HALF_EXTENT = 0.3  # m; the table is a square centred on the origin
CELL = 0.002  # m


@dataclass(frozen=True)
class Surface:
    """Friction of a material.

    friction: mean coefficient. variation: standard deviation of its logarithm over the table. correlation: correlation
    length, m. pressure_variation: standard deviation of the logarithm of a support point's load, from the misfit of
    slider and table. contact_variation: the same for the contact friction.
    """

    name: str
    friction: float
    variation: float
    correlation: float
    pressure_variation: float
    contact_variation: float


SURFACES = {
    surface.name: surface
    for surface in (
        Surface("abs", 0.15, 0.20, 0.012, 0.60, 0.20),
        Surface("delrin", 0.13, 0.10, 0.020, 0.40, 0.15),
        Surface("plywood", 0.25, 0.30, 0.008, 0.60, 0.20),
        Surface("pu", 0.33, 0.20, 0.025, 0.80, 0.25),
    )
}


def surface_named(name: str) -> Surface:
    """The surface of that name. Raises RigError for a name that is not in SURFACES."""
    if name not in SURFACES:
        raise RigError(f"surface: {name!r} is not accepted, give one of {', '.join(SURFACES)}")
    return SURFACES[name]


@dataclass(frozen=True, eq=False)
class FrictionField:
    """Friction coefficients on a square grid (G, G), row along y, from -HALF_EXTENT in steps of CELL."""

    values: Array

    def at(self, x: Array, y: Array) -> Array:
        """Coefficients at world points x, y (same shape, m), bilinear; beyond the table those of its rim."""
        size = self.values.shape[0]
        column = np.minimum(np.maximum((x + HALF_EXTENT) / CELL, 0.0), size - 1.001)
        row = np.minimum(np.maximum((y + HALF_EXTENT) / CELL, 0.0), size - 1.001)
        i, j = column.astype(np.intp), row.astype(np.intp)
        u, v = column - i, row - j
        flat, corner = self.values.ravel(), j * size + i
        low = flat.take(corner) * (1.0 - u) + flat.take(corner + 1) * u
        high = flat.take(corner + size) * (1.0 - u) + flat.take(corner + (size + 1)) * u
        return np.asarray(low * (1.0 - v) + high * v)


def friction_field(surface: Surface, seed: int) -> FrictionField:
    """A random table: log-normal with the surface's mean, variation and correlation length."""
    size = round(2.0 * HALF_EXTENT / CELL) + 1
    white = np.random.default_rng([seed, 1]).standard_normal((size, size))
    smooth = gaussian_filter(white, surface.correlation / CELL / np.sqrt(2.0), mode="wrap")
    smooth = (smooth - smooth.mean()) / smooth.std()
    return FrictionField(surface.friction * np.exp(surface.variation * smooth - surface.variation**2 / 2.0))
