# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Convex polygons: how far points lie inside, and the gap between a polygon and a moved one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.types import Array

STRAIGHT = 1e-12  # m^2; a corner whose edges span less counts as straight


def is_convex(vertices: Array) -> bool:
    """Whether a polygon (V, 2) in m turns to the left at each vertex, and once in all."""
    along = np.roll(vertices, -1, axis=0) - vertices
    after = np.roll(along, -1, axis=0)
    turns = along[:, 0] * after[:, 1] - along[:, 1] * after[:, 0]
    headings = np.arctan2(turns, np.sum(along * after, axis=1))
    return bool(np.all(turns > STRAIGHT) and np.isclose(headings.sum(), 2.0 * np.pi))


@dataclass(frozen=True, eq=False)
class ConvexPolygon:
    """A convex polygon with vertices (V, 2) in m, counter-clockwise. Raises RequestError."""

    vertices: Array

    def __post_init__(self) -> None:
        vertices = np.array(self.vertices, dtype=np.float64)
        if vertices.ndim != 2 or vertices.shape[1:] != (2,) or len(vertices) < 3:
            raise RequestError("polygon", vertices.tolist(), "at least three [x, y] in metres")
        if not np.all(np.isfinite(vertices)):
            raise RequestError("polygon", vertices.tolist(), "finite [x, y] in metres")
        if not is_convex(vertices):
            raise RequestError("polygon", vertices.tolist(), "the corners of a convex polygon, counter-clockwise")
        vertices.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)

    @cached_property
    def normals(self) -> Array:
        """Outward unit normals (V, 2) of the edges; edge k begins at vertex k."""
        along = np.roll(self.vertices, -1, axis=0) - self.vertices
        along = along / np.linalg.norm(along, axis=1, keepdims=True)
        return np.stack([along[:, 1], -along[:, 0]], axis=1)

    @cached_property
    def offsets(self) -> Array:
        """Distances (V,) in m of the edges' lines from the origin, along their normals."""
        return np.asarray(np.sum(self.normals * self.vertices, axis=1))

    def depth(self, points: Array) -> Array:
        """Distances (...) in m of points (..., 2) from the nearest edge's line: positive inside, negative outside."""
        inside = self.offsets[:, None] - self.normals @ points.reshape(-1, 2).T
        return np.asarray(inside.min(axis=0).reshape(points.shape[:-1]))

    def gap(self, body: ConvexPolygon, poses: Array) -> Array:
        """Gaps (n,) in m between this polygon and a body at poses (n, 3); zero or less where they touch.

        It is the largest over the normals of all edges: the distance if an edge is nearest, less if two corners are.
        Source: the separating axis theorem (Ericson, Real-Time Collision Detection, 2005, section 5.2.1).
        """
        along = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
        x, y = poses[:, :2].T
        body_centre = np.stack([along[0] * x + along[1] * y, along[0] * y - along[1] * x])  # the centre in body axes
        nearest = _least(self.normals, body.vertices, along) + self.normals @ poses[:, :2].T - self.offsets[:, None]
        around = _least(body.normals, self.vertices, along * [[1.0], [-1.0]]) - body.normals @ body_centre
        return np.asarray(np.maximum(nearest.max(axis=0), (around - body.offsets[:, None]).max(axis=0)))


def _least(normals: Array, vertices: Array, along: Array) -> Array:
    """Least extent (j, n) along normals (j, 2) of vertices (v, 2) rotated by n angles; along (2, n): cosine, sine."""
    across = normals[:, 1:] * vertices[:, 0] - normals[:, :1] * vertices[:, 1]
    table = np.stack([normals @ vertices.T, across], axis=-1)
    return np.asarray((table @ along).min(axis=1))
