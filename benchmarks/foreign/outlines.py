# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Outlines of the slider: contact points, support patches, and the surface on which the pusher's centre moves.

A tip of radius r that touches the slider has its centre on the outline's offset curve. Every outline
therefore answers one question: which point of the outline is closest to a given point outside or just inside.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from benchmarks.support.plane import Array, direction, quarter_turn


class Outline(Protocol):
    """A convex outline with its area centroid at the origin, vertices counter-clockwise, lengths in m."""

    @property
    def name(self) -> str:
        """Name of the shape in the rig's record."""

    @property
    def vertices(self) -> Array:
        """Vertices (n, 2), m."""

    @property
    def edges(self) -> int:
        """Number of sides; 1 for a smooth outline."""

    @property
    def parameters(self) -> dict[str, float | str] | None:
        """The record's shape_parameters of a smooth outline."""

    def boundary(self, contact: Array) -> tuple[Array, Array]:
        """Points and outward normals at fractions `contact` of the perimeter."""

    def closest(self, points: Array) -> tuple[Array, Array, Array]:
        """Closest outline points, outward normals there, and signed distances (positive outside)."""

    def contact_of(self, points: Array) -> Array:
        """Fractions of the perimeter of outline points."""


@dataclass(frozen=True)
class Polygon:
    """A regular polygon with `corners` corners on a circle of `circumradius` m; the first corner at `phase` rad."""

    name: str
    corners: int
    circumradius: float
    phase: float
    parameters: None = None

    @cached_property
    def vertices(self) -> Array:
        """The corners (n, 2), m."""
        angles = self.phase + 2 * np.pi * np.arange(self.corners) / self.corners
        return np.asarray(self.circumradius * direction(angles))

    @property
    def edges(self) -> int:
        """Number of sides."""
        return self.corners

    @cached_property
    def _sides(self) -> tuple[Array, Array, Array, float]:
        """Start points, unit tangents, outward normals and the common side length."""
        along = np.roll(self.vertices, -1, axis=0) - self.vertices
        length = float(np.linalg.norm(along[0]))
        tangents = along / length
        return self.vertices, tangents, -quarter_turn(tangents), length

    def boundary(self, contact: Array) -> tuple[Array, Array]:
        """Points and outward normals at fractions `contact` of the perimeter."""
        starts, tangents, normals, length = self._sides
        side = np.minimum((contact * self.corners).astype(int), self.corners - 1)
        along = (contact * self.corners - side) * length
        return starts[side] + along[:, None] * tangents[side], normals[side]

    def closest(self, points: Array) -> tuple[Array, Array, Array]:
        """Closest outline points, outward normals there, and signed distances (positive outside)."""
        starts, tangents, normals, length = self._sides
        height = points @ normals.T - np.sum(starts * normals, axis=1)
        side = np.argmax(height, axis=1)
        tangent, normal, start = tangents[side], normals[side], starts[side]
        along = np.clip(np.sum((points - start) * tangent, axis=1), 0.0, length)
        foot = start + along[:, None] * tangent
        apart = points - foot
        distance = np.sqrt(np.sum(apart**2, axis=1))
        signed = np.take_along_axis(height, side[:, None], axis=1)[:, 0]
        outside = (signed > 0) & (distance > 1e-9)
        rounded = apart / np.maximum(distance, 1e-12)[:, None]
        return foot, np.where(outside[:, None], rounded, normal), np.where(outside, distance, signed)

    def contact_of(self, points: Array) -> Array:
        """Fractions of the perimeter of outline points."""
        starts, tangents, normals, length = self._sides
        height = points @ normals.T - np.sum(starts * normals, axis=1)
        side = np.argmax(height, axis=1)
        along = np.sum((points - starts[side]) * tangents[side], axis=1) / length
        return np.asarray((side + np.clip(along, 0.0, 1.0)) / self.corners % 1.0)


@dataclass(frozen=True)
class Ellipse:
    """An ellipse with semi-axes `a` (body x) and `b` (body y), m; its first vertex lies on the positive x axis."""

    name: str
    a: float
    b: float
    samples: int = 128
    edges: int = 1

    @property
    def parameters(self) -> dict[str, float | str]:
        """Type and semi-axes, as the record states them."""
        return {"type": "ellipse", "a": self.a, "b": self.b}

    @cached_property
    def vertices(self) -> Array:
        """Points (n, 2) at equal steps of the ellipse's parameter, m."""
        return self._point(np.linspace(0, 2 * np.pi, self.samples, endpoint=False))

    def _point(self, parameter: Array) -> Array:
        return np.stack([self.a * np.cos(parameter), self.b * np.sin(parameter)], axis=-1)

    def _normal(self, parameter: Array) -> Array:
        raw = np.stack([self.b * np.cos(parameter), self.a * np.sin(parameter)], axis=-1)
        return np.asarray(raw / np.linalg.norm(raw, axis=-1, keepdims=True))

    @cached_property
    def _arc_table(self) -> tuple[Array, Array]:
        """Curve parameter and the fraction of the perimeter passed up to it."""
        parameter = np.linspace(0, 2 * np.pi, 2001)
        steps = np.linalg.norm(np.diff(self._point(parameter), axis=0), axis=1)
        passed = np.concatenate([[0.0], np.cumsum(steps)])
        return parameter, passed / passed[-1]

    def boundary(self, contact: Array) -> tuple[Array, Array]:
        """Points and outward normals at fractions `contact` of the perimeter."""
        parameter, passed = self._arc_table
        at = np.interp(contact, passed, parameter)
        return self._point(at), self._normal(at)

    def closest(self, points: Array) -> tuple[Array, Array, Array]:
        """Closest outline points, outward normals there, and signed distances (positive outside)."""
        at = np.arctan2(points[:, 1] * self.a, points[:, 0] * self.b)
        for _ in range(4):
            foot = self._point(at)
            slope = np.stack([-self.a * np.sin(at), self.b * np.cos(at)], axis=-1)
            apart = points - foot
            first = -np.sum(apart * slope, axis=1)
            # The second derivative of the squared distance; its lower bound keeps the step finite well inside.
            second = np.sum(slope**2, axis=1) + np.sum(apart * foot, axis=1)
            at = at - first / np.maximum(second, 0.1 * self.b**2)
        foot, normal = self._point(at), self._normal(at)
        return foot, normal, np.asarray(np.sum((points - foot) * normal, axis=1))

    def contact_of(self, points: Array) -> Array:
        """Fractions of the perimeter of outline points."""
        parameter, passed = self._arc_table
        at = np.arctan2(points[:, 1] / self.b, points[:, 0] / self.a) % (2 * np.pi)
        return np.asarray(np.interp(at, parameter, passed) % 1.0)


OUTLINES: dict[str, Outline] = {
    "rect1": Polygon("rect1", 4, 0.09 / np.sqrt(2), -3 * np.pi / 4),
    "hex": Polygon("hex", 6, 0.0605, 0.0),
    "ellip2": Ellipse("ellip2", 0.13089 / 2, 0.105 / 2),
    "ellip3": Ellipse("ellip3", 0.157 / 2, 0.105 / 2),
}


def patch_grid(outline: Outline, count: int = 64) -> Array:
    """About `count` points spread evenly over the outline's area, centred on the origin, shape (patches, 2), m."""
    reach = float(np.max(np.abs(outline.vertices)))
    spacing = reach
    patches = np.zeros((0, 2))
    while len(patches) < count:
        spacing *= 0.96
        lines = np.arange(-np.ceil(reach / spacing), np.ceil(reach / spacing)) * spacing + spacing / 2
        grid = np.stack(np.meshgrid(lines, lines), axis=-1).reshape(-1, 2)
        patches = grid[outline.closest(grid)[2] < 0]
    return np.asarray(patches - patches.mean(axis=0))
