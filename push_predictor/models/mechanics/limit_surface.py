"""Quasi-static motion of a pushed slider through an ellipsoidal limit surface.

Lynch, Maekawa and Tanie 1992 (IROS), after Goyal, Ruina and Papadopoulos 1991: the friction between slider
and surface bears forces f and moments m about the centre of friction with (f / fmax)^2 + (m / mmax)^2 = 1,
and the slider moves along the normal of that ellipsoid: v = k f, w = k m / c^2, c = mmax / fmax, k > 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ellipe

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
        return Support((0.0, 0.0), float(4.0 / (3.0 * np.pi) * a * ellipe(1.0 - (b / a) ** 2)))
    x, y = outline.centroid
    length = _integral_of_distance(outline.vertices - outline.centroid) / outline.area
    return Support((float(x), float(y)), length)


def body_twist(
    contact_point: Array, inward_normal: Array, pusher_velocity: Array, support: Support, friction: float
) -> tuple[Array, IntArray]:
    """Twist (n, 3: vx, vy, w) of the body frame's origin under a point pusher, and slip of the contact (n,).

    contact_point (n, 2) in m, inward_normal (n, 2) of length 1, pusher_velocity (n, 2) in m/s: all in the
    body frame; the twist has the velocity's units, and rad/s. Slip is 0 where the pusher sticks, +1 where it
    slips to the left of the inward normal, -1 to the right. A pusher that does not approach the slider leaves
    it at rest, with slip 0.

    The velocity at the contact is A f (force f, A = 1 + perp(r) perp(r)^T / c^2, r from the centre of
    friction). The images of the friction cone's edges under A bound the motion cone (Mason 1986): inside it
    the contact sticks and moves with the pusher, outside it the force lies on the nearer edge and only normal
    velocities agree.
    """
    normal_arm, tangent_arm = _moment_arms(contact_point, inward_normal, support)
    nx, ny = inward_normal[:, 0], inward_normal[:, 1]
    along = pusher_velocity[:, 0] * nx + pusher_velocity[:, 1] * ny
    across = pusher_velocity[:, 1] * nx - pusher_velocity[:, 0] * ny
    p, q = normal_arm, tangent_arm
    normal_force, tangent_force, slip = contact_force(1.0 + p * p, p * q, 1.0 + q * q, along, across, friction)
    spin = (normal_arm * normal_force + tangent_arm * tangent_force) / support.length
    x, y = support.centre
    vx = nx * normal_force - ny * tangent_force + spin * y
    vy = ny * normal_force + nx * tangent_force - spin * x
    return np.stack([vx, vy, spin], axis=1), slip


def _moment_arms(contact_point: Array, inward_normal: Array, support: Support) -> tuple[Array, Array]:
    """Moments per c of unit forces along the inward normal and along its left, each (n,)."""
    rx = (contact_point[:, 0] - support.centre[0]) / support.length
    ry = (contact_point[:, 1] - support.centre[1]) / support.length
    nx, ny = inward_normal[:, 0], inward_normal[:, 1]
    return rx * ny - ry * nx, rx * nx + ry * ny


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
