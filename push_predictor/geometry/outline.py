# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The outline of a slider: contact fractions and points, normals, nearest points.

The body frame has its origin at the outline's area centroid (docs/reference/push.md). A contact is a fraction of the
perimeter, counter-clockwise from the first vertex. Circles and ellipses are stored as polygons, but their points and
normals are those of the smooth curve.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.errors import RigError
from push_predictor.geometry import boundary
from push_predictor.geometry.frames import paired, rotate, to_body, to_world
from push_predictor.types import Array, BoolArray, IntArray

SMOOTH_TABLE = 8192  # chords that approximate the arc length of an ellipse: relative error 1e-8
SAME_LENGTH = 1e-6  # m; tolerance of vertices and their images under a symmetry
CENTRED = (0.0, 0.0, 0.0)  # pose of axes that are those of the body frame


@dataclass(frozen=True)
class Projection:
    """Nearest boundary points of n query points.

    point (n, 2), outward normal (n, 2), signed distance (n,) in m (negative inside), at_vertex (n,): whether a
    polygon's corner is nearest. contacts_of: computes the contacts, which the mechanics do not need.
    """

    point: Array
    normal: Array
    distance: Array
    at_vertex: BoolArray
    contacts_of: Callable[[], Array]

    @cached_property
    def contact(self) -> Array:
        """Contacts (n,)."""
        return self.contacts_of()


@dataclass(frozen=True, eq=False)
class Outline:
    """A closed outline in the body frame.

    vertices: (V, 2) in m, counter-clockwise. semi_axes: (a, b) in m for a circle or an ellipse, else None; pose: x, y
    (m) and angle (rad) of these axes in the body frame. Raises RigError if the vertices do not make a counter-clockwise
    polygon.
    """

    vertices: Array
    semi_axes: tuple[float, float] | None = None
    pose: tuple[float, float, float] = CENTRED

    def __post_init__(self) -> None:
        vertices = np.array(self.vertices, dtype=np.float64)
        if vertices.ndim != 2 or vertices.shape[1:] != (2,) or len(vertices) < 3:
            raise RigError(f"outline: shape {vertices.shape} is not accepted, give at least three [x, y] in metres")
        if not np.all(np.isfinite(vertices)):
            raise RigError("outline: a vertex is not finite, give [x, y] in metres")
        if signed_area(vertices) <= 0.0:
            raise RigError("outline: the vertices run clockwise or enclose nothing, give them counter-clockwise")
        vertices.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)

    def __reduce__(self) -> tuple[type[Outline], tuple[object, ...]]:
        """Pickle the fields alone: copies and keys of caches do not depend on what was computed before."""
        return Outline, (self.vertices, self.semi_axes, *([] if self.pose == CENTRED else [self.pose]))

    @cached_property
    def perimeter(self) -> float:
        """Length of the boundary, m."""
        return float(self._arc[-1])

    @cached_property
    def area(self) -> float:
        """Enclosed area, m^2."""
        if self.semi_axes is not None:
            return float(np.pi * self.semi_axes[0] * self.semi_axes[1])
        return signed_area(self.vertices)

    @cached_property
    def centroid(self) -> Array:
        """Area centroid (2,), m: zero in the body frame of docs/reference/push.md."""
        if self.semi_axes is not None:
            return np.array(self.pose[:2])
        x, y = self.vertices.T
        xn, yn = np.roll(x, -1), np.roll(y, -1)
        cross = x * yn - xn * y
        moments = np.array([np.sum((x + xn) * cross), np.sum((y + yn) * cross)])
        return np.asarray(moments / (3.0 * np.sum(cross)))

    @cached_property
    def polar_moment(self) -> float:
        """Mean squared distance from the centroid over the enclosed area, m^2."""
        if self.semi_axes is not None:
            return (self.semi_axes[0] ** 2 + self.semi_axes[1] ** 2) / 4.0
        here = self.vertices - self.centroid
        after = np.roll(here, -1, axis=0)
        cross = here[:, 0] * after[:, 1] - after[:, 0] * here[:, 1]
        squares = np.sum(here * here + here * after + after * after, axis=1)
        return float(np.sum(cross * squares) / (6.0 * np.sum(cross)))

    @cached_property
    def reach(self) -> float:
        """Distance of the farthest vertex from the origin, m."""
        return float(np.max(np.linalg.norm(self.vertices, axis=1)))

    @cached_property
    def rotational_symmetry(self) -> int:
        """Order of the rotational symmetry about the origin: square 4, ellipse 2, 1 for none, 0 for a circle."""
        if self.semi_axes is not None:
            if np.hypot(*self.pose[:2]) > SAME_LENGTH:
                return 1
            return 0 if np.isclose(*self.semi_axes, rtol=0.0, atol=SAME_LENGTH) else 2
        count = len(self.vertices)
        orders = (k for k in range(count, 1, -1) if count % k == 0 and self._unchanged_by_turn(k))
        return next(orders, 1)

    @cached_property
    def edge_starts(self) -> Array:
        """Contact fractions (E + 1,) at which the edges begin, the last entry 1; a smooth outline is one edge."""
        if self.semi_axes is not None:
            return np.array([0.0, 1.0])
        # Rounded, so that the k-th side of a square begins exactly at k / 4.
        return np.asarray(np.round(self._arc / self._arc[-1], 15))

    def edge(self, contact: Array) -> tuple[IntArray, Array]:
        """Edge index (n,) and fraction along that edge (n,) of contacts (n,) in [0, 1)."""
        starts, lengths = self.edge_starts, self._edge_shares
        index = starts.searchsorted(contact, side="right") - 1
        index = np.minimum(np.maximum(index, 0), len(lengths) - 1)  # np.clip takes several times as long
        fraction = (contact - starts[index]) / lengths[index]
        return index, np.minimum(np.maximum(fraction, 0.0), 1.0)

    @cached_property
    def _edge_shares(self) -> Array:
        return np.diff(self.edge_starts)

    def contact_on_edge(self, edge: IntArray | int, fraction: Array | float) -> Array:
        """The contacts at fractions of edges; the end of an edge belongs to it, not to the next edge."""
        start, end = self.edge_starts[edge], self.edge_starts[np.asarray(edge) + 1]
        return np.asarray(np.clip(start + fraction * (end - start), start, np.nextafter(end, 0.0)))

    def point(self, contact: Array) -> Array:
        """Boundary points (n, 2) in m at contacts (n,)."""
        if self.semi_axes is not None:
            return self._curve(self._curve_parameter(contact))
        edge, fraction = self.edge(contact)
        start = self.vertices[edge]
        return np.asarray(start + fraction[:, None] * (self._ends[edge] - start))

    def inward_normal(self, contact: Array) -> Array:
        """Unit normals (n, 2) into the slider at contacts (n,)."""
        if self.semi_axes is not None:
            return -self._curve_normal(self._curve_parameter(contact))
        return -self._edge_normals[self.edge(contact)[0]]

    def project(self, points: Array) -> Projection:
        """Nearest boundary points of points (n, 2) in the body frame."""
        points = np.array(points, dtype=np.float64, ndmin=2, order="C")
        found = np.empty((len(points), 8))
        boundary.project(points, self.boundary, found)
        edge, share, corner = found[:, 5].astype(np.int64), found[:, 6], found[:, 7] > 0.0
        if self.semi_axes is not None:
            return Projection(found[:, :2], found[:, 2:4], found[:, 4], corner, lambda: self._arc_at(share))
        edge, share = (edge, share) if not corner.any() else self._facing(edge, share, found[:, 2:4], corner)
        return Projection(found[:, :2], found[:, 2:4], found[:, 4], corner, lambda: self.contact_on_edge(edge, share))

    @cached_property
    def boundary(self) -> Array:
        """The outline as the compiled functions take it, SI units, one number after the other.

        Number of edges and of points of the curve m; semi-axes, x, y and angle of their pose; polar moment; 9 per edge
        (x, y of the start, x, y along it, square of its length, outward normal x, y, contact at the start, share of the
        perimeter); m lengths along the curve; m parameters there. A polygon has no curve but a zero, a smooth outline
        no edges.
        """
        if self.semi_axes is not None:
            head = [0.0, len(self._arc), *self.semi_axes, *self.pose, self.polar_moment]
            return np.concatenate([head, self._arc, self._table])
        along, starts = self._ends - self.vertices, self.edge_starts
        columns = [self.vertices, along, np.sum(along**2, axis=1), self._edge_normals, starts[:-1], self._edge_shares]
        head = [len(along), 1.0, *np.zeros(5), self.polar_moment]
        return np.concatenate([head, np.column_stack(columns).ravel(), np.zeros(2)])

    # --- polygons -----------------------------------------------------------------------------------------------

    @cached_property
    def _ends(self) -> Array:
        return np.roll(self.vertices, -1, axis=0)

    def _facing(self, edge: IntArray, share: Array, normal: Array, corner: BoolArray) -> tuple[IntArray, Array]:
        """At a corner, the edge that faces the point more, and the corner's place on it.

        Both edges are equally near, and rounding must not decide from which normal the angle of a push counts.
        """
        other = np.where(share < 0.5, edge - 1, edge + 1) % len(self.vertices)
        faces = np.einsum("enk,nk->en", self._edge_normals[np.stack([edge, other])], normal)
        swapped = corner & (faces[1] > faces[0])
        return np.where(swapped, other, edge), np.where(swapped, 1.0 - share, share)

    @cached_property
    def _edge_normals(self) -> Array:
        along = self._ends - self.vertices
        along = along / np.linalg.norm(along, axis=1, keepdims=True)
        return np.stack([along[:, 1], -along[:, 0]], axis=1)

    @cached_property
    def _arc(self) -> Array:
        points = (
            self._curve(self._table) if self.semi_axes is not None else np.vstack([self.vertices, self.vertices[:1]])
        )
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])

    def _unchanged_by_turn(self, order: int) -> bool:
        angle = 2.0 * np.pi / order
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        image = self.vertices @ turn.T
        return bool(np.allclose(image, np.roll(self.vertices, -(len(image) // order), axis=0), atol=SAME_LENGTH))

    # --- circles and ellipses -----------------------------------------------------------------------------------

    @cached_property
    def _table(self) -> Array:
        a, b = self.semi_axes or (1.0, 1.0)
        first = self.vertices[:1]
        x, y = (first if self.pose == CENTRED else to_body(first, np.array(self.pose)))[0]
        return np.asarray(np.arctan2(y / b, x / a) + np.linspace(0.0, 2.0 * np.pi, SMOOTH_TABLE + 1))

    def _curve(self, parameter: Array) -> Array:
        a, b = self.semi_axes or (1.0, 1.0)
        points = paired(a * np.cos(parameter), b * np.sin(parameter))
        return points if self.pose == CENTRED else to_world(points, np.array(self.pose))

    def _curve_normal(self, parameter: Array) -> Array:
        a, b = self.semi_axes or (1.0, 1.0)
        normal = paired(b * np.cos(parameter), a * np.sin(parameter))
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        return np.asarray(normal if self.pose == CENTRED else rotate(normal, np.array(self.pose[2])))

    def _curve_parameter(self, contact: Array) -> Array:
        return np.asarray(np.interp(np.asarray(contact) * self.perimeter, self._arc, self._table))

    def _arc_at(self, parameter: Array) -> Array:
        """Contacts (n,) of the curve's parameters (n,)."""
        turned = self._table[0] + (parameter - self._table[0]) % (2.0 * np.pi)
        contact = np.interp(turned, self._table, self._arc) / self.perimeter
        return np.asarray(np.clip(contact, 0.0, np.nextafter(1.0, 0.0)))


def signed_area(vertices: Array) -> float:
    """The area (m^2) that vertices (V, 2) enclose, negative if they run clockwise."""
    x, y = vertices.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
