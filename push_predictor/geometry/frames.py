# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Angles and planar frames (REP 103: x forward, y left, angles counter-clockwise), and poses in space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from push_predictor.types import Array


def wrap_angle(angle: Array) -> Array:
    """Angles (rad, any shape) wrapped to [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi, dtype=np.float64)


def rotate(vectors: Array, angle: Array) -> Array:
    """Vectors (..., 2) rotated counter-clockwise by angle (..., rad)."""
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return paired(np.asarray(cos * x - sin * y), np.asarray(sin * x + cos * y))


def paired(x: Array, y: Array) -> Array:
    """Points (..., 2) of coordinates (...); np.stack takes several times as long."""
    points = np.empty((*x.shape, 2))
    points[..., 0], points[..., 1] = x, y
    return points


def to_body(points: Array, poses: Array) -> Array:
    """World points (..., 2) in the body frame of poses (..., 3: x, y, heading)."""
    return rotate(points - poses[..., :2], -poses[..., 2])


def to_world(points: Array, poses: Array) -> Array:
    """Body points (..., 2) of bodies at poses (..., 3: x, y, heading) in the world frame."""
    return rotate(points, poses[..., 2]) + poses[..., :2]


def yaw_of_quaternion(x: Array, y: Array, z: Array, w: Array) -> Array:
    """Heading about the vertical (rad) of unit quaternions; roll and pitch are ignored."""
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def tilt_of_quaternion(x: Array, y: Array, z: Array, w: Array) -> Array:
    """Angles (rad, 0 to pi) between the vertical and the z axes that unit quaternions turn."""
    return np.asarray(2.0 * np.arctan2(np.hypot(x, y), np.hypot(z, w)))


def quaternion_of_yaw(yaw: Array) -> tuple[Array, Array]:
    """The (z, w) parts of the unit quaternion that turns by yaw (rad) about the vertical; x = y = 0."""
    return np.sin(yaw / 2.0), np.cos(yaw / 2.0)


# --- poses in space, for requests in frames that are tilted in the world ----------------------------------------------


@dataclass(frozen=True, eq=False)
class SpatialPose:
    """The pose of a body in a frame, or of one frame in another.

    position (3,) m; quaternion (4,: x, y, z, w) of unit length. `outer @ inner` transforms a pose given in the frame
    `outer` into the frame in which `outer` is given.
    """

    position: Array
    quaternion: Array

    def __matmul__(self, inner: SpatialPose) -> SpatialPose:
        return SpatialPose(self.point(inner.position), quaternion_product(self.quaternion, inner.quaternion))

    @property
    def inverse(self) -> SpatialPose:
        """The pose of the outer frame in the inner one."""
        return SpatialPose(-self.rotation.T @ self.position, self.quaternion * [-1.0, -1.0, -1.0, 1.0])

    @cached_property
    def rotation(self) -> Array:
        """Matrix (3, 3) that transforms vectors of the inner frame into the outer one."""
        x, y, z, w = self.quaternion
        return np.array(
            [
                [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
                [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
                [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
            ]
        )

    @property
    def tilt(self) -> float:
        """Angle between the two z axes, rad, from 0 to pi."""
        return float(2.0 * np.arctan2(np.hypot(*self.quaternion[:2]), np.hypot(*self.quaternion[2:])))

    def point(self, point: Array) -> Array:
        """A point (3,) m of the inner frame, in the outer one."""
        return np.asarray(self.rotation @ point + self.position)

    def vector(self, vector: Array) -> Array:
        """A vector (3,) of the inner frame, in the outer one; the frames are at rest to each other."""
        return np.asarray(self.rotation @ vector)

    def covariance(self, covariance: Array) -> Array:
        """A pose's covariance (6, 6: x, y, z, rotations about x, y, z), in the outer frame's axes."""
        turn = np.zeros((6, 6))
        turn[:3, :3] = turn[3:, 3:] = self.rotation
        return np.asarray(turn @ covariance @ turn.T)

    def turned(self, angle: float) -> SpatialPose:
        """The same position, rotated by angle (rad) about the vertical of the outer frame."""
        return SpatialPose(self.position, quaternion_product(vertical_turn(angle), self.quaternion))


SAME_FRAME = SpatialPose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))


def vertical_turn(angle: float) -> Array:
    """Quaternion (4,) of a rotation by angle (rad) about z."""
    z, w = quaternion_of_yaw(np.asarray(angle))
    return np.array([0.0, 0.0, z, w])


def quaternion_product(second: Array, first: Array) -> Array:
    """Quaternion (4,) of the rotation `first` followed by the rotation `second`."""
    x, y, z, w = second.tolist()
    a, b, c, d = first.tolist()
    return np.array(
        [
            w * a + x * d + y * c - z * b,
            w * b - x * c + y * d + z * a,
            w * c + x * b - y * a + z * d,
            w * d - x * a - y * b - z * c,
        ]
    )
