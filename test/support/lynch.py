# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Quasi-static pushing on an ellipsoidal limit surface in closed form (Lynch, Maekawa and Tanie 1992), and by steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, to_body
from push_predictor.geometry.outline import Outline
from push_predictor.models.mechanics.surface import PowerSurface
from push_predictor.types import Array


@dataclass(frozen=True)
class Instant:
    """Contacts of n pushes in the body frame: point, inward normal, direction of the push, and twist per metre."""

    point: Array
    normal: Array
    ahead: Array
    twist: Array

    @property
    def contact(self) -> Array:
        """Velocity (n, 2) of the slider where it is touched."""
        (vx, vy, spin), (x, y) = self.twist.T, self.point.T
        return np.column_stack([vx - spin * y, vy + spin * x])

    def along(self, vector: Array) -> tuple[Array, Array]:
        """Parts of a vector (n, 2) along the normal and to its left."""
        across = self.normal[:, 0] * vector[:, 1] - self.normal[:, 1] * vector[:, 0]
        return np.sum(vector * self.normal, axis=1), across


def lynch(at: Instant, surface: PowerSurface, left: Array, right: Array) -> tuple[Array, Array]:
    """Twists (n, 3), and the angle (n,) of the force to the normal, which the friction cone limits.

    The force that makes the contact stick solves two linear equations. One outside the cone lies on its edge.
    """
    arm = (at.point - surface.centre) / surface.length
    q, p = at.along(arm)  # moments over length of unit forces to the left of the normal, and along it
    p = -p
    along, across = at.along(at.ahead)
    stick = np.linalg.solve(
        np.stack([1.0 + p * p, p * q, p * q, 1.0 + q * q], axis=1).reshape(-1, 2, 2),
        np.stack([along, across], axis=1)[:, :, None],
    )[:, :, 0]
    wanted = np.arctan2(stick[:, 1], stick[:, 0])
    angle = np.clip(wanted, -np.arctan(right), np.arctan(left))
    c, s = np.cos(angle), np.sin(angle)
    size = along / (c * (1.0 + p * p) + s * p * q)
    force = size[:, None] * (c[:, None] * at.normal + s[:, None] * rotate(at.normal, np.full(len(c), 0.5 * np.pi)))
    spin = (arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]) / surface.length
    return np.column_stack([force + spin[:, None] * surface.centre[::-1] * [1.0, -1.0], spin]), angle


@dataclass(frozen=True)
class Sweeps:
    """Straight paths of a disc in the frame of the sliders' first poses: start, direction (n, 2), travel (n,)."""

    outline: Outline
    radius: float
    start: Array
    ahead: Array
    travel: Array

    def at_end(self, pose: Array) -> tuple[Array, Array]:
        """Gap (n,) to the slider at a pose, and how much the disc approaches it (n,)."""
        nearest = self.outline.project(to_body(self.start + self.travel[:, None] * self.ahead, pose))
        return nearest.distance - self.radius, -np.sum(rotate(self.ahead, -pose[:, 2]) * nearest.normal, axis=1)


def sweeps(outline: Outline, radius: float, inputs: Array, duration: Array) -> Sweeps:
    """The paths of pushes."""
    normal = outline.inward_normal(inputs[:, 1])
    start = outline.point(inputs[:, 1]) - radius * normal
    return Sweeps(outline, radius, start, rotate(normal, inputs[:, 2]), inputs[:, 0] * duration)
