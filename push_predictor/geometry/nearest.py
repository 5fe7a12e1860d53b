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

"""The nearest boundary point of a single point, and the point of a contact, in floats instead of arrays.

The results equal those of Outline up to rounding, and are ten times faster than with an array of one row.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from math import atan2, copysign, cos, hypot, inf, pi, sin, sqrt
from typing import TypeAlias

import numpy as np

from push_predictor.geometry.outline import CENTRED, NEWTON_STEPS, PARAMETER_TOLERANCE, Outline

# From x, y in m to: x, y of the nearest point, x, y of its outward normal, signed distance in m (negative inside).
Nearest: TypeAlias = Callable[[float, float], tuple[float, float, float, float, float]]
# From a contact to: x, y of its point in m, x, y of the inward normal there.
ContactAt: TypeAlias = Callable[[float], tuple[float, float, float, float]]


def nearest_on(outline: Outline) -> Nearest:
    """The nearest-point function of an outline, in the body frame."""
    if outline.semi_axes is None:
        return _on_polygon(outline)
    centred = _on_ellipse(*outline.semi_axes)
    return centred if outline.pose == CENTRED else _placed(centred, *outline.pose)


def _placed(centred: Nearest, x0: float, y0: float, turn: float) -> Nearest:
    """The function for an ellipse whose axes have another pose."""
    c, s = cos(turn), sin(turn)

    def nearest(x: float, y: float) -> tuple[float, float, float, float, float]:
        x, y = x - x0, y - y0
        px, py, nx, ny, distance = centred(c * x + s * y, c * y - s * x)
        return x0 + c * px - s * py, y0 + s * px + c * py, c * nx - s * ny, s * nx + c * ny, distance

    return nearest


def _on_polygon(outline: Outline) -> Nearest:
    ends = np.roll(outline.vertices, -1, axis=0)
    along = ends - outline.vertices
    squared = np.sum(along**2, axis=1)
    normals = outline.edge_lines[:2].T
    edges = [tuple(row) for row in np.column_stack([outline.vertices, ends[:, 1], along, squared, normals]).tolist()]
    general = _on_any_polygon(edges)
    if not outline.is_convex:
        return general
    lines = [tuple(line) for line in outline.edge_lines.T.tolist()]
    last = lines[0]  # where the disc touches most often touches again

    def nearest(x: float, y: float) -> tuple[float, float, float, float, float]:
        """Of a convex polygon: on an edge that the point is opposite, outside; there can be only one."""
        normal_x, normal_y, offset, along_x, along_y, first = last
        most = x * normal_x + y * normal_y - offset
        if most > 0.0 and 0.0 < x * along_x + y * along_y - first < 1.0:
            return x - most * normal_x, y - most * normal_y, normal_x, normal_y, most
        return on_farthest_edge(x, y)

    def on_farthest_edge(x: float, y: float) -> tuple[float, float, float, float, float]:
        """On the edge with the largest signed distance, unless a corner is nearest."""
        nonlocal last
        most = -inf
        for line in lines:
            nx, ny, offset, _, _, _ = line
            if (distance := x * nx + y * ny - offset) > most:
                most, at = distance, line
        normal_x, normal_y, _, along_x, along_y, first = last = at
        if most > 0.0 and not 0.0 < x * along_x + y * along_y - first < 1.0:
            return general(x, y)
        return x - most * normal_x, y - most * normal_y, normal_x, normal_y, most

    return nearest


def _on_any_polygon(edges: list[tuple[float, ...]]) -> Nearest:
    """edges: x, y of the first vertex, y of the second, x, y from first to second, its square, outward normal x, y."""

    def nearest(x: float, y: float) -> tuple[float, float, float, float, float]:
        least, inside = inf, False
        share = away_x = away_y = normal_x = normal_y = 0.0
        for x0, y0, y1, along_x, along_y, square, nx, ny in edges:
            from_x, from_y = x - x0, y - y0
            part = (from_x * along_x + from_y * along_y) / square
            part = 0.0 if part < 0.0 else 1.0 if part > 1.0 else part
            ax, ay = from_x - part * along_x, from_y - part * along_y
            if (distance := ax * ax + ay * ay) < least:
                least, share, away_x, away_y, normal_x, normal_y = distance, part, ax, ay, nx, ny
            if (y0 > y) != (y1 > y) and x < x0 + from_y * along_x / along_y:
                inside = not inside
        length = sqrt(least)
        if inside:
            return x - away_x, y - away_y, normal_x, normal_y, -length
        if length > 0.0 and not 0.0 < share < 1.0:  # a corner is nearest
            normal_x, normal_y = away_x / length, away_y / length
        return x - away_x, y - away_y, normal_x, normal_y, length

    return nearest


def _on_ellipse(a: float, b: float) -> Nearest:
    def nearest(x: float, y: float) -> tuple[float, float, float, float, float]:
        t = _parameter(a, b, abs(x), abs(y))
        c, s = copysign(cos(t), x), copysign(sin(t), y)
        px, py, nx, ny = a * c, b * s, b * c, a * s
        size = hypot(nx, ny)
        nx, ny = nx / size, ny / size
        return px, py, nx, ny, (x - px) * nx + (y - py) * ny

    return nearest


def _parameter(a: float, b: float, x: float, y: float) -> float:
    """Parameter of the curve point nearest to x, y >= 0, by Newton's method safeguarded by bisection."""
    t, low, high, skew = atan2(a * y, b * x), 0.0, 0.5 * pi, b * b - a * a
    for _ in range(NEWTON_STEPS):
        c, s = cos(t), sin(t)
        slope = skew * c * s + x * a * s - y * b * c
        bend = skew * (c * c - s * s) + x * a * c + y * b * s
        low, high = (low, t) if slope > 0.0 else (t, high)
        newton = t - slope / bend if bend > 0.0 else inf
        before, t = t, newton if low <= newton <= high else 0.5 * (low + high)
        if abs(t - before) < PARAMETER_TOLERANCE:
            break
    return t


def contact_on(outline: Outline) -> ContactAt:
    """The function from a contact to its point and inward normal, in the body frame."""
    if outline.semi_axes is not None:
        return _contact_on_ellipse(outline, *outline.semi_axes)
    starts = outline.edge_starts.tolist()
    ends = np.roll(outline.vertices, -1, axis=0)
    along = ends - outline.vertices
    inward = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    edges = [tuple(row) for row in np.column_stack([outline.vertices, along, inward]).tolist()]

    def at(contact: float) -> tuple[float, float, float, float]:
        k = min(max(bisect_right(starts, contact) - 1, 0), len(edges) - 1)
        share = (contact - starts[k]) / (starts[k + 1] - starts[k])
        share = 0.0 if share < 0.0 else 1.0 if share > 1.0 else share
        x, y, along_x, along_y, nx, ny = edges[k]
        return x + share * along_x, y + share * along_y, nx, ny

    return at


def _contact_on_ellipse(outline: Outline, a: float, b: float) -> ContactAt:
    lengths, parameters = outline.curve_table
    arc, table, perimeter = lengths.tolist(), parameters.tolist(), outline.perimeter
    (x0, y0, turn), centred = outline.pose, outline.pose == CENTRED
    cos_turn, sin_turn = cos(turn), sin(turn)

    def at(contact: float) -> tuple[float, float, float, float]:
        place = min(max(contact * perimeter, 0.0), arc[-1])
        k = min(bisect_right(arc, place) - 1, len(arc) - 2)
        t = table[k] + (place - arc[k]) * (table[k + 1] - table[k]) / (arc[k + 1] - arc[k])
        c, s = cos(t), sin(t)
        size = hypot(b * c, a * s)
        x, y, nx, ny = a * c, b * s, -b * c / size, -a * s / size
        if centred:
            return x, y, nx, ny
        return (
            x0 + cos_turn * x - sin_turn * y,
            y0 + sin_turn * x + cos_turn * y,
            cos_turn * nx - sin_turn * ny,
            sin_turn * nx + cos_turn * ny,
        )

    return at
