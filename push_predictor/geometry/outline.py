# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
from push_predictor.geometry.convex import is_convex
from push_predictor.geometry.frames import paired, rotate, to_body, to_world
from push_predictor.types import Array, BoolArray, IntArray

SMOOTH_TABLE = 8192  # chords that approximate the arc length of an ellipse: relative error 1e-8
NEWTON_STEPS = 60  # enough for bisection alone
PARAMETER_TOLERANCE = 1e-14  # rad
ROUNDING = 1e-12  # m; a point this near to a corner has the normal of an edge, not the direction of a rounding error
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
        if _signed_area(vertices) <= 0.0:
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
        return float(_signed_area(self.vertices))

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
        starts = self.edge_starts
        index = np.clip(np.searchsorted(starts, contact, side="right") - 1, 0, len(starts) - 2)
        fraction = (contact - starts[index]) / (starts[index + 1] - starts[index])
        return index.astype(np.int64), np.clip(fraction, 0.0, 1.0)

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
        points = np.atleast_2d(np.asarray(points, dtype=np.float64))
        return self._project_smooth(points) if self.semi_axes is not None else self._project_polygon(points)

    # --- polygons -----------------------------------------------------------------------------------------------

    @cached_property
    def _ends(self) -> Array:
        return np.roll(self.vertices, -1, axis=0)

    @cached_property
    def _edges(self) -> tuple[Array, Array]:
        """Edges (V, 2) as vectors in m, and their squared lengths (V,)."""
        along = self._ends - self.vertices
        return along, np.asarray(np.sum(along**2, axis=1))

    @cached_property
    def _edge_columns(self) -> tuple[Array, ...]:
        """Columns (V, 1): x, y of the edges' first vertices, x, y along them, and their squared lengths."""
        along, squared = self._edges
        return tuple(column[:, None].copy() for column in (*self.vertices.T, *along.T, squared))

    @cached_property
    def is_convex(self) -> bool:
        """Whether the vertices make a convex polygon without straight corners."""
        return is_convex(self.vertices)

    @cached_property
    def edge_lines(self) -> Array:
        """Of the edges (6, V): outward normal x, y and distance of the line from the origin in that direction; x, y and
        constant of the share of the edge, from its first vertex on, at which a point's foot lies.
        """
        along, squared = self._edges
        shares = along / squared[:, None]
        of_normal, of_share = ((self.vertices * factors).sum(axis=1) for factors in (self._edge_normals, shares))
        return np.stack([*self._edge_normals.T, of_normal, *shares.T, of_share])

    @cached_property
    def _shift_per_rise(self) -> Array:
        """Of edges (V, 1), change of x per change of y; of level edges, which no level line crosses, any number."""
        along, rise = self._edges[0].T[..., None]
        return np.asarray(along / np.where(rise == 0.0, 1.0, rise))

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

    def _project_polygon(self, points: Array) -> Projection:
        return self._project_convex(points) if self.is_convex else self._project_any(points)

    def _project_convex(self, points: Array) -> Projection:
        """On the edge whose line a point lies farthest outside; the nearest corner can only be one of its ends."""
        (x, y), (normal_x, normal_y, offset, *_) = points.T, self.edge_lines[:, :, None]
        edge = (x * normal_x + y * normal_y - offset).argmax(axis=0)
        nx, ny, offset, share_x, share_y, first = self.edge_lines.take(edge, axis=1)
        distance, share = x * nx + y * ny - offset, x * share_x + y * share_y - first
        away_x, away_y = distance * nx, distance * ny
        at_vertex = ((share <= 0.0) | (share >= 1.0)) & (distance > ROUNDING)
        if at_vertex.any():
            along_x, along_y = self._edges[0].T.take(edge, axis=1)
            beyond = np.where(at_vertex, share - np.where(share < 0.5, 0.0, 1.0), 0.0)
            away_x, away_y = away_x + beyond * along_x, away_y + beyond * along_y
            distance = np.where(at_vertex, np.sqrt(away_x * away_x + away_y * away_y), distance)
            divisor = np.where(at_vertex, distance, 1.0)
            nx, ny = np.where(at_vertex, away_x / divisor, nx), np.where(at_vertex, away_y / divisor, ny)
        nearest = paired(x - away_x, y - away_y)
        return Projection(nearest, paired(nx, ny), distance, at_vertex, lambda: self.contact_on_edge(edge, share))

    def _project_any(self, points: Array) -> Projection:
        """Of any polygon: of the nearest points of its edges, the nearest."""
        # By edge first and by coordinate: arrays of n numbers in a row, where those of two would be slow.
        x0, y0, along_x, along_y, squared = self._edge_columns
        offset_x, offset_y = points[:, 0] - x0, points[:, 1] - y0
        fraction = (offset_x * along_x + offset_y * along_y) / squared
        fraction = np.minimum(np.maximum(fraction, 0.0), 1.0)
        away_x, away_y = offset_x - fraction * along_x, offset_y - fraction * along_y
        distance = away_x * away_x + away_y * away_y
        edge = distance.argmin(axis=0)
        nearest = edge * len(points) + np.arange(len(points))  # flat: take is faster than indices of both axes
        share, length = fraction.take(nearest), np.sqrt(distance.take(nearest))
        away = paired(away_x.take(nearest), away_y.take(nearest))
        inside = self._contains(offset_x, offset_y)
        at_vertex = ((share <= 0.0) | (share >= 1.0)) & ~inside & (length > 0.0)
        radial = away / np.maximum(length, 1e-300)[:, None]
        normal = np.where(at_vertex[:, None], radial, self._edge_normals.take(edge, axis=0))
        distance = np.where(inside, -length, length)
        return Projection(points - away, normal, distance, at_vertex, lambda: self.contact_on_edge(edge, share))

    def _contains(self, offset_x: Array, offset_y: Array) -> BoolArray:
        """Which of n points lie inside; offsets (V, n) of each from the vertices."""
        below = offset_y < 0.0
        crosses = below != np.concatenate([below[1:], below[:1]])
        right_of = offset_x < offset_y * self._shift_per_rise
        return np.asarray(np.logical_xor.reduce(crosses & right_of, axis=0))

    # --- circles and ellipses -----------------------------------------------------------------------------------

    @cached_property
    def _table(self) -> Array:
        a, b = self.semi_axes or (1.0, 1.0)
        x, y = self._in_axes(self.vertices[:1])[0]
        first = np.arctan2(y / b, x / a)
        return np.asarray(first + np.linspace(0.0, 2.0 * np.pi, SMOOTH_TABLE + 1))

    @property
    def curve_table(self) -> tuple[Array, Array]:
        """Lengths along a smooth outline's curve in m, and the curve's parameters there, both increasing."""
        return self._arc, self._table

    def _curve(self, parameter: Array) -> Array:
        a, b = self.semi_axes or (1.0, 1.0)
        points = paired(a * np.cos(parameter), b * np.sin(parameter))
        return points if self.pose == CENTRED else to_world(points, np.array(self.pose))

    def _curve_normal(self, parameter: Array) -> Array:
        a, b = self.semi_axes or (1.0, 1.0)
        normal = paired(b * np.cos(parameter), a * np.sin(parameter))
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        return np.asarray(normal if self.pose == CENTRED else rotate(normal, np.array(self.pose[2])))

    def _in_axes(self, points: Array) -> Array:
        """Points (n, 2) of the body frame along the semi-axes."""
        return points if self.pose == CENTRED else to_body(points, np.array(self.pose))

    def _curve_parameter(self, contact: Array) -> Array:
        return np.asarray(np.interp(np.asarray(contact) * self.perimeter, self._arc, self._table))

    def _project_smooth(self, points: Array) -> Projection:
        parameter = self._nearest_parameter(self._in_axes(points))
        nearest, normal = self._curve(parameter), self._curve_normal(parameter)
        distance = np.einsum("nj,nj->n", points - nearest, normal)
        nowhere = np.zeros(len(points), dtype=np.bool_)
        return Projection(nearest, normal, distance, nowhere, lambda: self._curve_contact(parameter))

    def _curve_contact(self, parameter: Array) -> Array:
        """Contacts (n,) of the curve's parameters (n,)."""
        turned = self._table[0] + (parameter - self._table[0]) % (2.0 * np.pi)
        contact = np.interp(turned, self._table, self._arc) / self.perimeter
        return np.asarray(np.clip(contact, 0.0, np.nextafter(1.0, 0.0)))

    def _nearest_parameter(self, points: Array) -> Array:
        """Safeguarded Newton's method in the first quadrant, where the slope has a single root."""
        a, b = self.semi_axes or (1.0, 1.0)
        x, y = np.abs(points.T)
        t, low, high = np.arctan2(a * y, b * x), np.zeros_like(x), np.full_like(x, np.pi / 2.0)
        ax, by, skew = x * a, y * b, b * b - a * a
        for _ in range(NEWTON_STEPS):  # stationarity of |curve(t) - point|^2
            cos, sin = np.cos(t), np.sin(t)
            slope = skew * cos * sin + ax * sin - by * cos
            bend = skew * (cos * cos - sin * sin) + ax * cos + by * sin
            falls, bends = slope > 0.0, bend > 0.0
            low, high = np.where(falls, low, t), np.where(falls, t, high)
            newton = t - slope / np.where(bends, bend, np.inf)
            usable = bends & (newton >= low) & (newton <= high)
            before, t = t, np.where(usable, newton, (low + high) / 2.0)
            if np.all(np.abs(t - before) < PARAMETER_TOLERANCE):
                break
        return np.asarray(np.arctan2(np.copysign(np.sin(t), points[:, 1]), np.copysign(np.cos(t), points[:, 0])))


def _signed_area(vertices: Array) -> float:
    x, y = vertices.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
