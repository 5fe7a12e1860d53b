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

"""Quasi-static motion of a pushed slider through an ellipsoidal limit surface.

Lynch, Maekawa and Tanie 1992 (IROS), after Goyal, Ruina and Papadopoulos 1991: the friction between slider
and surface bears forces f and moments m about the centre of friction with (f / fmax)^2 + (m / mmax)^2 = 1,
and the slider moves along the normal of that ellipsoid: v = k f, w = k m / c^2, c = mmax / fmax, k > 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from push_predictor.errors import RigError
from push_predictor.types import Array, IntArray

if TYPE_CHECKING:
    from push_predictor.geometry.outline import Outline


@dataclass(frozen=True)
class Support:
    """The pressure distribution under a slider, as far as its quasi-static motion depends on it.

    centre: centre of friction (x, y) in the body frame, m. length: c = mmax / fmax, m.
    Raises RigError if a value is not finite or the length is not positive.
    """

    centre: tuple[float, float]
    length: float

    def __post_init__(self) -> None:
        if not (np.all(np.isfinite(self.centre)) and np.isfinite(self.length) and self.length > 0.0):
            raise RigError(
                f"support: centre {self.centre} m, length {self.length} m is not accepted, "
                "give finite numbers and a length above 0"
            )


def uniform_support(outline: Outline) -> Support:
    """The support of a slider with uniform pressure: centre at the area centroid, c = mean |r|.

    Exact: in closed form over the triangles that a polygon's edges make with the centroid, and through the
    complete elliptic integral for a circle or an ellipse, whose mean |r| is 2 / 3 of the mean of |r| over the
    curve's parameter.
    """
    if outline.semi_axes is not None:
        a, b = sorted(outline.semi_axes, reverse=True)
        return Support(outline.pose[:2], float(4.0 / (3.0 * np.pi) * a * scipy.special.ellipe(1.0 - (b / a) ** 2)))
    x, y = outline.centroid
    length = _integral_of_distance(outline.vertices - outline.centroid) / outline.area
    return Support((float(x), float(y)), length)


def contact_force(
    pp: Array, pq: Array, qq: Array, along: Array, across: Array, friction: float | Array
) -> tuple[Array, Array, IntArray]:
    """Force (scaled to k = 1) along the inward normal and its left, and slip, each (n,).

    pp, pq, qq (n,): elements of the contact's mobility A in the basis of normal and left, 1 + p^2, p q, 1 + q^2 for the
    moment arms p, q; along, across (n,): the pusher's velocity in that basis. Where an edge's image has no component
    along the normal, slip in that direction would separate slider and pusher: the motion cone covers that side.
    """
    left_n, left_t = pp + friction * pq, pq + friction * qq
    right_n, right_t = pp - friction * pq, pq - friction * qq
    left = (left_n > 0.0) & (across * left_n > along * left_t)
    right = (right_n > 0.0) & (across * right_n < along * right_t)
    determinant = pp * qq - pq * pq
    slip = left.astype(np.int64) - right.astype(np.int64)
    edge = along / np.where(left, left_n, np.where(right, right_n, 1.0))
    normal = np.where(slip == 0, (qq * along - pq * across) / determinant, edge)
    tangent = np.where(slip == 0, (pp * across - pq * along) / determinant, slip * friction * edge)
    touching = along > 0.0
    return normal * touching, tangent * touching, slip * touching


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
