# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Array types and plane geometry of the independent rigs: vectors along the last axis, angles in rad."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def direction(angle: Array | float) -> Array:
    """Unit vectors (..., 2) at the given angles."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def quarter_turn(vectors: Array) -> Array:
    """Vectors turned by 90 degrees counter-clockwise."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def rotate(vectors: Array, angle: Array) -> Array:
    """Vectors (..., 2) turned counter-clockwise by angles (...)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)


def dot(first: Array, second: Array) -> Array:
    """Scalar products."""
    return np.asarray(np.sum(first * second, axis=-1))


def cross(first: Array, second: Array) -> Array:
    """The z components of the cross products."""
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])


def wrapped(angle: Array) -> Array:
    """Angles folded into [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
