# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Outlines of the slider: points on them, the nearest point to the tip, and where a support point may lie."""

import json
from dataclasses import dataclass

import numpy as np

from benchmarks.support.plane import Array, BoolArray, IntArray, cross, dot, quarter_turn

ELLIPSE_VERTICES = 128


@dataclass(frozen=True)
class Nearest:
    """The outline's nearest points to given points: place (P, 2) in m, distance (P,) in m and edge (P,)."""

    point: Array
    distance: Array
    edge: IntArray


@dataclass(frozen=True)
class Outline:
    """A convex outline in the body frame, counter-clockwise, centred on its area centroid; lengths in m."""

    shape: str
    vertices: Array  # (E, 2)
    semi_axes: tuple[float, float] | None = None  # of an ellipse

    @property
    def edges(self) -> int:
        """Number of sides; an ellipse has one."""
        return len(self.vertices) if self.semi_axes is None else 1

    @property
    def reach(self) -> float:
        """Largest distance of the outline from its centre, m."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    def at(self, fraction: Array) -> tuple[Array, Array]:
        """Points (P, 2) and inward normals (P, 2) at fractions of the perimeter."""
        sides = np.roll(self.vertices, -1, axis=0) - self.vertices
        lengths = np.linalg.norm(sides, axis=1)
        ends = np.cumsum(lengths)
        travelled = np.mod(fraction, 1.0) * ends[-1]
        edge = np.minimum(np.searchsorted(ends, travelled, side="right"), len(ends) - 1)
        along = (travelled - ends[edge] + lengths[edge]) / lengths[edge]
        points = self.vertices[edge] + along[:, None] * sides[edge]
        if self.semi_axes is None:
            return points, quarter_turn(sides[edge]) / lengths[edge][:, None]
        angle = np.arctan2(points[:, 1] / self.semi_axes[1], points[:, 0] / self.semi_axes[0])
        return self._on_ellipse(angle), self._ellipse_normal(angle)

    def nearest(self, points: Array) -> Nearest:
        """Find the outline's nearest points to points (P, 2) outside it."""
        if self.semi_axes is None:
            return self._nearest_on_polygon(points)
        a, b = self.semi_axes
        angle = np.arctan2(points[:, 1] * a, points[:, 0] * b)
        for _ in range(6):
            apart = self._on_ellipse(angle) - points
            tangent = np.stack([-a * np.sin(angle), b * np.cos(angle)], axis=1)
            slope = dot(tangent, tangent) - dot(apart, self._on_ellipse(angle))
            angle = angle - dot(apart, tangent) / np.maximum(slope, 1e-6)
        place = self._on_ellipse(angle)
        return Nearest(place, np.linalg.norm(points - place, axis=1), np.zeros(len(points), dtype=np.int64))

    def contains(self, points: Array, margin: float) -> BoolArray:
        """Whether points (P, 2) lie inside by at least `margin` metres."""
        sides = np.roll(self.vertices, -1, axis=0) - self.vertices
        lengths = np.linalg.norm(sides, axis=1)
        depth = cross(sides, points[:, None, :] - self.vertices) / lengths
        return np.asarray(depth.min(axis=1) > margin)

    def record(self) -> dict[str, str]:
        """The outline's entries of the `push_rig` record."""
        entries = {"shape": self.shape, "outline": json.dumps([[float(x), float(y)] for x, y in self.vertices])}
        if self.semi_axes is not None:
            a, b = self.semi_axes
            entries["shape_parameters"] = json.dumps({"type": "ellipse", "a": a, "b": b})
        return entries

    def _nearest_on_polygon(self, points: Array) -> Nearest:
        sides = np.roll(self.vertices, -1, axis=0) - self.vertices
        apart = points[:, None, :] - self.vertices
        along = np.clip(dot(apart, sides) / dot(sides, sides), 0.0, 1.0)
        places = self.vertices + along[..., None] * sides
        distances = np.linalg.norm(points[:, None, :] - places, axis=2)
        edge = distances.argmin(axis=1)
        rows = np.arange(len(points))
        return Nearest(places[rows, edge], distances[rows, edge], edge)

    def _on_ellipse(self, angle: Array) -> Array:
        assert self.semi_axes is not None
        return np.stack([self.semi_axes[0] * np.cos(angle), self.semi_axes[1] * np.sin(angle)], axis=1)

    def _ellipse_normal(self, angle: Array) -> Array:
        assert self.semi_axes is not None
        outward = np.stack([self.semi_axes[1] * np.cos(angle), self.semi_axes[0] * np.sin(angle)], axis=1)
        return np.asarray(-outward / np.linalg.norm(outward, axis=1, keepdims=True))


def rectangle(shape: str, length: float, width: float) -> Outline:
    """A rectangle of the given full sides, m."""
    corners = np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
    return Outline(shape, corners * [length / 2, width / 2])


def ellipse(a: float, b: float) -> Outline:
    """An ellipse of the given semi-axes, m."""
    angle = np.arange(ELLIPSE_VERTICES) * 2 * np.pi / ELLIPSE_VERTICES
    return Outline("ellipse", np.stack([a * np.cos(angle), b * np.sin(angle)], axis=1), (a, b))


def hexagon(radius: float) -> Outline:
    """A regular hexagon of the given circumradius, m."""
    angle = np.arange(6) * np.pi / 3
    return Outline("hexagon", radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
