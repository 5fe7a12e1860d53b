# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Array types and small planar helpers that all modules share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]


def cross(a: Floats, b: Floats) -> Floats:
    """Planar cross product of vectors along the last axis."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def turned_left(vector: Floats) -> Floats:
    """Rotate vectors along the last axis by +90 degrees."""
    return np.stack([-vector[..., 1], vector[..., 0]], axis=-1)


def rotate(vector: Floats, angle: Floats) -> Floats:
    """Rotate vectors along the last axis by `angle` (rad, shape of the leading axes)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y = vector[..., 0], vector[..., 1]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)


def unit(angle: Floats) -> Floats:
    """Unit vectors of the directions `angle`, rad."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def rotation_matrices(angle: Floats) -> Floats:
    """Rotation matrices, shape (..., 2, 2), for `angle` in rad."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([np.stack([cosine, -sine], axis=-1), np.stack([sine, cosine], axis=-1)], axis=-2)


def wrapped(angle: Floats) -> Floats:
    """Angles folded into [-pi, pi), rad."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
