# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The pressure distribution under a slider: points of support with shares of the load.

A patch is a grid of points whose pressure may grow or fall towards the rim, by one exponent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.errors import RigError
from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import Outline
from push_predictor.types import Array

RAYS, RADII = 40, 8  # of a patch whose rim is visible from its centroid
GRID_POINTS = 400  # of any other, approximately
ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class PressureDistribution:
    """Points of support (k, 2) in m, body frame, and their shares (k,) of the load, which sum to 1.

    spread: standard deviation in m, along x and along y, of the small area that each point stands for; 0 for points.
    Raises RigError for fewer than two distinct points, a share below 0, or numbers that are not finite.
    """

    points: Array
    shares: Array
    spread: float = 0.0

    def __post_init__(self) -> None:
        points, shares = np.asarray(self.points, dtype=np.float64), np.asarray(self.shares, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 2 or shares.shape != points.shape[:1]:
            raise RigError(f"support_points: shapes {points.shape}, {shares.shape} are not accepted, give (k, 2), (k,)")
        if not (np.all(np.isfinite(points)) and np.all(np.isfinite(shares)) and np.all(shares >= 0.0)):
            raise RigError("support_points: give finite coordinates in m and load shares >= 0")
        loaded = points[shares > 0.0]
        if len(loaded) < 2 or np.all(loaded == loaded[0]):
            raise RigError(
                "support_points: fewer than two loaded points, a slider needs a support that resists turning"
            )
        object.__setattr__(self, "points", loaded)
        total = float(shares.sum())
        known = abs(total - 1.0) < ROUNDING  # dividing again would change the last bits of shares from a file
        object.__setattr__(self, "shares", shares[shares > 0.0] / (1.0 if known else total))

    @property
    def centre(self) -> Array:
        """Centre of pressure (2,), m, body frame."""
        return np.asarray(self.shares @ self.points)

    @property
    def length(self) -> float:
        """C = mmax / fmax in m: the mean distance of the load from its centre."""
        return float(self.shares @ np.linalg.norm(self.points - self.centre, axis=1))


def supported_at(support_points: Array) -> PressureDistribution:
    """The distribution of a rig's support_points (k, 3: x, y in m, load share). Raises RigError."""
    points = np.asarray(support_points, dtype=np.float64)
    return PressureDistribution(points[:, :2], points[:, 2])


def patch(outline: Outline, rim_exponent: float = 0.0) -> PressureDistribution:
    """A patch over the outline; exponent 0 is even pressure.

    With e > 0 the pressure is rho^e, with e < 0 it is (1 - rho)^-e. rho is 1 at the rim and 0 in the middle: at the
    centroid, from which it grows in proportion, or for an outline with hidden parts where the rim is farthest.
    """
    points, rho, area, spread = _fan(outline) if _visible_from_centroid(outline) else _grid(outline)
    weight = area * (rho**rim_exponent if rim_exponent >= 0.0 else (1.0 - rho) ** -rim_exponent)
    return PressureDistribution(points, weight / weight.sum(), spread)


def _visible_from_centroid(outline: Outline) -> bool:
    x, y = (outline.vertices - outline.centroid).T
    return bool(np.all(x * np.roll(y, -1) - np.roll(x, -1) * y > 0.0))


def _fan(outline: Outline) -> tuple[Array, Array, Array, float]:
    """Gauss points on rays from the centroid: points (k, 2), rho (k,), area (k,), spread."""
    radius, of_radius = _gauss(RADII)
    if outline.semi_axes is not None:
        turn = (np.arange(RAYS) + 0.5) * 2.0 * np.pi / RAYS
        rim = rotate(np.column_stack([np.cos(turn), np.sin(turn)]) * outline.semi_axes, np.array(outline.pose[2]))
        of_ray = np.ones(RAYS)
    else:
        here, there = outline.vertices - outline.centroid, np.roll(outline.vertices, -1, axis=0) - outline.centroid
        share, of_share = _gauss(max(2, round(RAYS / len(here))))
        rim = (here[:, None] + share[:, None] * (there - here)[:, None]).reshape(-1, 2)
        cross = here[:, 0] * there[:, 1] - here[:, 1] * there[:, 0]
        of_ray = (cross[:, None] * of_share).ravel()
    points = outline.centroid + (radius[:, None, None] * rim).reshape(-1, 2)
    area = (radius[:, None] * of_radius[:, None] * of_ray).ravel()
    area = area / area.sum()
    return points, np.repeat(radius, len(rim)), area, float(np.sqrt(outline.area / len(points) / 12.0))


def _gauss(count: int) -> tuple[Array, Array]:
    """Nodes and weights of Gauss-Legendre quadrature on 0 to 1."""
    node, weight = np.polynomial.legendre.leggauss(count)
    return 0.5 * (node + 1.0), 0.5 * weight


def _grid(outline: Outline) -> tuple[Array, Array, Array, float]:
    """Cells of a grid: points (k, 2), rho (k,), area (k,), spread."""
    low, high = outline.vertices.min(axis=0), outline.vertices.max(axis=0)
    cells = np.ceil((high - low) / np.sqrt(outline.area / GRID_POINTS)).astype(int)
    ticks = [a + (np.arange(n) + 0.5) * (b - a) / n for a, b, n in zip(low, high, cells, strict=True)]
    grid = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    depth = -outline.project(grid).distance
    inside = depth > 0.0
    rho = 1.0 - depth[inside] / depth.max()
    return grid[inside], rho, np.ones(len(rho)), float(np.sqrt(np.prod((high - low) / cells) / 12.0))
