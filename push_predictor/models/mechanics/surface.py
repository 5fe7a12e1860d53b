# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The limit surfaces of pushes, as the compiled kernel takes them: tables, or a power law without one."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
import scipy

from push_predictor.errors import RigError
from push_predictor.geometry.outline import Outline
from push_predictor.models.mechanics.load_map import DIRECTIONS, LoadMap, load_map
from push_predictor.models.mechanics.pressure import PressureDistribution, patch
from push_predictor.types import Array

EXPONENT_KNOTS = (-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 12.0)
SQUARE_OF_SPREAD = 9.0 / 16.0  # mean square of a coordinate over c squared, of an even disc
_NO_NODES, NO_SLOPES = np.zeros((0, 0, 0, 4)), np.zeros((0, 0, 0, 8))


@dataclass(frozen=True, eq=False)
class PowerSurface:
    """The cheap approximation (f / fmax)^p + (m / mmax)^p = 1; p = 2 is the ellipsoid of Lynch et al. (1992).

    centre (2,) of friction and length c = mmax / fmax, m, body frame. Raises RigError if a value is not finite or the
    length is not positive.
    """

    centre: Array
    length: float
    power: float = 2.0

    def __post_init__(self) -> None:
        if not (np.all(np.isfinite(self.centre)) and np.isfinite(self.length) and self.length > 0.0):
            raise RigError(
                f"support: centre {np.asarray(self.centre).tolist()} m, length {self.length} m is not accepted, "
                "give finite numbers and a length above 0"
            )


def uniform_ellipsoid(outline: Outline) -> PowerSurface:
    """The ellipsoid of a slider with uniform pressure: centre at the area centroid, c = mean |r|.

    Exact: in closed form over the triangles that a polygon's edges make with the centroid, and through the complete
    elliptic integral for a circle or an ellipse, whose mean |r| is 2 / 3 of the mean of |r| over the curve's parameter.
    """
    if outline.semi_axes is not None:
        a, b = sorted(outline.semi_axes, reverse=True)
        length = 4.0 / (3.0 * np.pi) * a * scipy.special.ellipe(1.0 - (b / a) ** 2)
        return PowerSurface(np.array(outline.pose[:2]), float(length))
    length = _integral_of_distance(outline.vertices - outline.centroid) / outline.area
    return PowerSurface(outline.centroid, float(length))


def _integral_of_distance(vertices: Array) -> float:
    """Integral of |r| over a polygon (V, 2: m) in m^3: the sum over its edges' triangles with the origin.

    In polar coordinates a triangle whose edge runs from s0 to s1 at the signed distance h gives the integral
    of (h / cos phi)^3 / 3, which is [h s |r| + h^3 asinh(s / h)] / 6 between the ends.
    """
    ends = np.roll(vertices, -1, axis=0)
    along = (ends - vertices) / np.linalg.norm(ends - vertices, axis=1, keepdims=True)
    height = vertices[:, 0] * along[:, 1] - vertices[:, 1] * along[:, 0]
    return float(np.sum(_antiderivative(ends, along, height) - _antiderivative(vertices, along, height)))


def _antiderivative(points: Array, along: Array, height: Array) -> Array:
    s, reach = np.sum(points * along, axis=1), np.linalg.norm(points, axis=1)
    distance = np.where(height == 0.0, 1.0, np.abs(height))  # an edge towards the origin adds nothing
    return np.asarray((height * s * reach + height**3 * np.arcsinh(s / distance)) / 6.0)


@dataclass(frozen=True, eq=False)
class SurfaceTables:
    """Surfaces that pushes are on or between: maps of known supports, then of patches by exponent; or a power law.

    quantities (T, 23): those of LoadMap, and the exponent of a patch, not a number for a known support.
    """

    quantities: Array
    maps: tuple[LoadMap, ...] = ()
    power: float = 0.0

    @cached_property
    def nodes(self) -> Array:
        """Those of all maps, (T, ELEVATIONS, AZIMUTHS + 1, 4)."""
        return np.stack([one.nodes for one in self.maps]) if self.maps else _NO_NODES

    @cached_property
    def slopes(self) -> Array:
        """Those of all maps, (T, ELEVATIONS, AZIMUTHS + 1, 8); each takes 0.1 s."""
        return np.stack([one.slopes for one in self.maps]) if self.maps else NO_SLOPES


def power_table(surface: PowerSurface) -> SurfaceTables:
    """A power law in place of tables."""
    c, spread = surface.length, SQUARE_OF_SPREAD * surface.length**2
    reach = np.full(DIRECTIONS, 1.0 / DIRECTIONS)  # of a disc
    quantities = np.concatenate([surface.centre, [c, spread, 0.0, spread], reach, [np.nan]])
    return SurfaceTables(quantities[None], power=surface.power)


def surface_tables(
    known: Sequence[PressureDistribution], outline: Outline, exponents: Sequence[float]
) -> SurfaceTables:
    """Tables of known supports, and of patches over the outline with these exponents, some of EXPONENT_KNOTS.

    A table that is used for the first time takes 0.1 s.
    """
    vertices = outline.vertices.tobytes()
    maps = [_known_map(one) for one in known]
    maps += [_patch_map(_Patch(vertices, outline.semi_axes, exponent, outline)) for exponent in exponents]
    knots = [*[np.nan] * len(known), *exponents]
    quantities = np.column_stack([np.stack([one.quantities for one in maps]), knots])
    return SurfaceTables(np.ascontiguousarray(quantities), tuple(maps))


def knots_about(low: float, high: float) -> tuple[float, ...]:
    """Those of EXPONENT_KNOTS between which exponents from low to high lie; beyond the ends, the last one."""
    last = len(EXPONENT_KNOTS) - 1
    first, end = bisect_right(EXPONENT_KNOTS, low) - 1, bisect_left(EXPONENT_KNOTS, high)
    return EXPONENT_KNOTS[min(max(first, 0), last) : min(max(end, 0), last) + 1]


@dataclass(frozen=True)
class _Patch:
    """An outline and its pressure; equal for equal outlines, so that all models of a slider share a table."""

    vertices: bytes
    semi_axes: tuple[float, float] | None
    exponent: float
    outline: Outline = field(compare=False)


@lru_cache(maxsize=64)
def _patch_map(key: _Patch) -> LoadMap:
    return load_map(patch(key.outline, key.exponent))


@lru_cache(maxsize=64)
def _known_map(pressure: PressureDistribution) -> LoadMap:
    return load_map(pressure)
