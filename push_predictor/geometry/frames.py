# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Angles and planar frames (REP 103: x forward, y left, angles counter-clockwise)."""

from __future__ import annotations

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
