# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Poses from numbers: position and quaternion, or a matrix, whose order (by row or by column) its own form shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from push_predictor.types import Array, BoolArray

ORTHONORMAL = 1e-2  # largest deviation of R R' from one; rounded to three decimals it is 2e-3
_LAST_ROW = np.array([0.0, 0.0, 0.0, 1.0])


def pose_rows_of(parts: Sequence[Array]) -> Array | None:
    """Rows (n, 7: position, quaternion) from the numbers (n, k) of one or two fields; None for other numbers.

    One field: 7 numbers; 16 of a 4x4 or 12 of a 3x4 matrix. Two, in any order: 3 of a position, 4 of a quaternion or 9
    of a rotation matrix by row. A row is NaN where the matrix is no rotation.
    """
    by_size = {part.shape[1]: part for part in parts}
    match sorted(by_size):
        case [7]:
            return by_size[7]
        case [3, 4]:
            return np.hstack([by_size[3], by_size[4]])
        case [3, 9]:
            return _posed(by_size[9].reshape(-1, 3, 3), by_size[3])
        case [16]:
            square = by_size[16].reshape(-1, 4, 4)
            return _best([square, square.transpose(0, 2, 1)])
        case [12]:
            return _best([by_size[12].reshape(-1, 3, 4), by_size[12].reshape(-1, 4, 3).transpose(0, 2, 1)])
    return None


def _best(readings: Sequence[Array]) -> Array:
    """The poses of that reading (n, 3 or 4, 4) of the matrices in which most are poses; of equal ones the first."""
    found = [_posed(each[:, :3, :3], each[:, :3, 3], _ends(each)) for each in readings]
    return max(found, key=lambda rows: int(np.sum(np.isfinite(rows[:, 0]))))


def _ends(matrices: Array) -> BoolArray:
    """Which matrices (n, 3 or 4, 4) have no last row, or that of a pose."""
    return np.asarray(np.abs(matrices[:, 3:] - _LAST_ROW).max(axis=(1, 2), initial=0.0) < ORTHONORMAL)


def _posed(rotation: Array, position: Array, known: BoolArray | bool = True) -> Array:
    """Rows (n, 7) of rotation matrices (n, 3, 3) and positions (n, 3); NaN where it is no rotation, or not known."""
    with np.errstate(invalid="ignore"):
        error = np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2), initial=0.0)
        sound = known & (error < ORTHONORMAL) & (_determinant(rotation) > 0.0)
    rows = np.full((len(position), 7), np.nan)
    rows[sound] = np.hstack([position[sound], _quaternions(rotation[sound])])
    return rows


def _determinant(rotation: Array) -> Array:
    return np.asarray(np.sum(rotation[:, 0] * np.cross(rotation[:, 1], rotation[:, 2]), axis=1))


def _quaternions(rotation: Array) -> Array:
    """Quaternions (n, 4: x, y, z, w) of the rotations nearest to matrices (n, 3, 3): Bar-Itzhack (2000), version 3."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.transpose(1, 2, 0)
    rows = [
        [xx - yy - zz, yx + xy, zx + xz, zy - yz],
        [yx + xy, yy - xx - zz, zy + yz, xz - zx],
        [zx + xz, zy + yz, zz - xx - yy, yx - xy],
        [zy - yz, xz - zx, yx - xy, xx + yy + zz],
    ]
    return np.asarray(np.linalg.eigh(np.array(rows).transpose(2, 0, 1))[1][:, :, -1])
