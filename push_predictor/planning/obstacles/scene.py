# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The table with its obstacles, and which poses of the slider are safe on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import ConvexHull
from scipy.special import ndtr

from push_predictor.errors import RequestError
from push_predictor.geometry.convex import ConvexPolygon
from push_predictor.geometry.outline import Outline
from push_predictor.types import Array, BoolArray

MOST_VERTICES = 32  # of a smooth outline; the chords of a circle with radius 50 mm are within 0.25 mm of it


@dataclass(frozen=True, eq=False, init=False)
class Scene:
    """A slider's outline, a convex table and convex obstacles on it.

    A pose is safe if the outline touches no obstacle and the slider's centre, its centre of mass, is over the table.
    An outline that is not convex is replaced by its convex hull. Raises RequestError for a polygon that is not convex.
    """

    outline: Outline
    table: ConvexPolygon
    obstacles: tuple[ConvexPolygon, ...]

    def __init__(self, outline: Outline, table: Array, obstacles: Sequence[Array] = ()) -> None:
        object.__setattr__(self, "outline", outline)
        object.__setattr__(self, "table", _polygon("table", table))
        polygons = tuple(_polygon(f"obstacles[{k}]", obstacle) for k, obstacle in enumerate(obstacles))
        object.__setattr__(self, "obstacles", polygons)

    def clearance(self, poses: Array) -> Array:
        """Margins (...) in m of poses (..., 3): positive if safe, zero or less if the slider touches or falls.

        The smaller of the gap to the nearest obstacle and the depth of the centre inside the table.
        """
        flat = poses.reshape(-1, 3)
        gaps = [obstacle.gap(self.body, flat) for obstacle in self.obstacles]
        return np.asarray(np.min([self.table.depth(flat[:, :2]), *gaps], axis=0).reshape(poses.shape[:-1]))

    def safe(self, poses: Array, margin: float = 0.0) -> BoolArray:
        """Whether the clearance of poses (..., 3) exceeds a margin (m), (...); faster than `clearance`."""
        flat = poses.reshape(-1, 3)
        safe = self.table.depth(flat[:, :2]) > margin
        for obstacle in self.obstacles:
            near = np.flatnonzero(safe & (-obstacle.depth(flat[:, :2]) - self._radius <= margin))
            safe[near] = obstacle.gap(self.body, flat[near]) > margin
        return np.asarray(safe.reshape(poses.shape[:-1]))

    def touch_probability(self, poses: Array, covariance: Array) -> Array:
        """Probability (...) that sliders with mean poses (..., 3) and covariance (..., 3, 3) are not safe.

        The clearance is taken for Gaussian, with the standard deviation of the farthest point of the outline.
        """
        variance = np.diagonal(covariance, axis1=-2, axis2=-1) @ [1.0, 1.0, self.outline.reach**2]
        return np.asarray(ndtr(-self.clearance(poses) / np.sqrt(np.maximum(variance, np.finfo(float).tiny))))

    @cached_property
    def body(self) -> ConvexPolygon:
        """The convex hull of the outline, in the body frame."""
        vertices = self.outline.vertices
        if self.outline.semi_axes is not None:
            vertices = vertices[:: max(1, len(vertices) // MOST_VERTICES)]
        return ConvexPolygon(vertices[ConvexHull(vertices).vertices])

    @cached_property
    def _radius(self) -> float:
        return float(np.hypot(*self.body.vertices.T).max())


def _polygon(field: str, vertices: Array) -> ConvexPolygon:
    try:
        return ConvexPolygon(vertices)
    except RequestError as error:
        raise RequestError(field, error.value, error.accepted) from None
