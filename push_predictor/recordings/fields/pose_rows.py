# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Poses in space as rows of numbers: composed, inverted, interpolated and turned upright, and wrenches turned by them.

A row is x, y, z (m) and a unit quaternion x, y, z, w.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType

import numpy as np

from push_predictor.recordings.dropouts import NANOSECOND, longest_interval
from push_predictor.types import Array, BoolArray, IntArray

_PARALLEL = 1.0 - 1e-10  # cosine above which a straight line between two quaternions is exact to rounding
ORTHONORMAL = 1e-2  # largest deviation of R R' from one; rounded to three decimals it is 2e-3
_LAST_ROW = np.array([0.0, 0.0, 0.0, 1.0])


def normalised(rows: Array) -> Array:
    """Rows (n, 7) with unit quaternions; a quaternion of length zero becomes NaN."""
    length = np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.hstack([rows[:, :3], np.where(length > 1e-6, rows[:, 3:] / length, np.nan)])


def composed(outer: Array, inner: Array) -> Array:
    """Poses (n, 7) given in frames whose poses (n, 7) are `outer`, in the frame in which `outer` is given."""
    q, p = outer[:, 3:], inner[:, 3:]
    vector = q[:, 3:] * p[:, :3] + p[:, 3:] * q[:, :3] + np.cross(q[:, :3], p[:, :3])
    scalar = q[:, 3] * p[:, 3] - np.sum(q[:, :3] * p[:, :3], axis=1)
    return np.column_stack([outer[:, :3] + turned(q, inner[:, :3]), vector, scalar])


def inverted(rows: Array) -> Array:
    """The poses (n, 7) of the outer frames in the inner ones."""
    inverse = rows[:, 3:] * [-1.0, -1.0, -1.0, 1.0]
    return np.hstack([-turned(inverse, rows[:, :3]), inverse])


def turned(quaternions: Array, vectors: Array) -> Array:
    """Vectors (n, 3) rotated by quaternions (n, 4)."""
    axis, w = quaternions[:, :3], quaternions[:, 3:]
    twice = 2.0 * np.cross(axis, vectors)
    return np.asarray(vectors + w * twice + np.cross(axis, twice))


def interpolated(first: Array, second: Array, share: Array) -> Array:
    """Poses (n, 7) at a share (n,) of the way from the first to the second, turning the shorter way round."""
    cosine = np.sum(first[:, 3:] * second[:, 3:], axis=1)
    sign = np.where(cosine < 0.0, -1.0, 1.0)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, _PARALLEL))
    near = np.abs(cosine) > _PARALLEL
    a = np.where(near, 1.0 - share, np.sin((1.0 - share) * angle) / np.sin(angle))
    b = np.where(near, share, np.sin(share * angle) / np.sin(angle))
    quaternion = a[:, None] * first[:, 3:] + (sign * b)[:, None] * second[:, 3:]
    position = (1.0 - share)[:, None] * first[:, :3] + share[:, None] * second[:, :3]
    return normalised(np.hstack([position, quaternion]))


def poses_at(stamp: IntArray, known: IntArray, rows: Array) -> Array:
    """Poses (n, 7) at stamps (n,) ns, interpolated between the samples of a stream: known (m,) ns, rows (m, 7).

    The samples may be in any order; of equal stamps the first counts. A row is NaN at a stamp outside the stream's time
    or in a dropout of it.
    """
    known, first = np.unique(known, return_index=True)
    if not len(known):
        return np.full((len(stamp), 7), np.nan)
    rows = rows[first]
    after = np.minimum(np.searchsorted(known, stamp), len(known) - 1)
    before = np.maximum(after - 1, 0)
    span = known[after] - known[before]
    found = interpolated(rows[before], rows[after], (stamp - known[before]) / np.maximum(span, 1))
    period = float(np.median(np.diff(known))) if len(known) > 1 else 0.0
    dropout = span * NANOSECOND > longest_interval(period * NANOSECOND)
    outside = (stamp < known[0]) | (stamp > known[-1]) | (dropout & (stamp != known[after]))
    return np.asarray(np.where(outside[:, None], np.nan, found))


def in_world_axes(wrenches: Array, poses: Array) -> Array:
    """Wrenches (n, 6: force N, torque N m) along a sensor's axes, along the world's; the torque keeps its point.

    poses (n, 7): of the sensor in the world, x, y, z (m) and a unit quaternion x, y, z, w.
    """
    quaternion = poses[:, 3:]
    return np.hstack([turned(quaternion, wrenches[:, :3]), turned(quaternion, wrenches[:, 3:])])


def at_tip(wrenches: Array, sensor: Array, tip: Array) -> Array:
    """Wrenches (n, 6) along a sensor's axes, along the world's and about the tip; sensor, tip: their poses (n, 7)."""
    return about_points(in_world_axes(wrenches, sensor), sensor[:, :3], tip[:, :3])


def about_points(wrenches: Array, origins: Array, points: Array) -> Array:
    """Wrenches (n, 6) whose torque is about origins (n, 3) m, with their torque about points (n, 3) m.

    All are along the same axes.
    """
    force = wrenches[:, :3]
    return np.hstack([force, wrenches[:, 3:] + np.cross(origins - points, force)])


# --- from numbers: position and quaternion, or a matrix, whose order its own form shows -------------------------------


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


# --- worlds whose up axis is not z ------------------------------------------------------------------------------------
#
# The world is turned about a horizontal axis: y up about x, x up about y, z down about x by half a turn. So the
# headings of two worlds that differ in their up axis may differ by a constant.

UP_AXES = ("x", "y", "z", "-x", "-y", "-z")
Z_UP, Z_DOWN = "z", "-z"
_HALF = np.sqrt(0.5)
# The quaternion that turns each axis into z.
_TURNS = MappingProxyType(
    {
        "x": (0.0, -_HALF, 0.0, _HALF),
        "y": (_HALF, 0.0, 0.0, _HALF),
        "z": (0.0, 0.0, 0.0, 1.0),
        "-x": (0.0, _HALF, 0.0, _HALF),
        "-y": (-_HALF, 0.0, 0.0, _HALF),
        "-z": (1.0, 0.0, 0.0, 0.0),
    }
)


def z_up(poses: Array, up: str) -> Array:
    """Poses (n, 7) of a world with this up axis, in the world that is turned so that z is up."""
    return poses if up == Z_UP else composed(_turns(up, len(poses)), poses)


def wrenches_z_up(wrenches: Array, up: str) -> Array:
    """Wrenches (n, 6) along the axes of a world with this up axis, along those of the turned world."""
    return in_world_axes(wrenches, _turns(up, len(wrenches)))


def bodies_z_up(poses: Array, up: str) -> Array:
    """Turned poses (n, 7), where the axis of the body that points up is z as well.

    A body that was defined in its world has the world's up axis as its own; its heading is the turn about that axis.
    """
    if up == Z_UP:
        return poses
    own = composed(poses, inverted(_turns(up, len(poses))))
    one, other = _upward(poses), _upward(own)
    # Half a turn keeps the z axis vertical: which of the two points up decides. Else the one that is vertical.
    is_own = other > one if up == Z_DOWN else np.abs(other) > np.abs(one)
    return np.where(is_own[:, None], own, poses)


def _upward(poses: Array) -> Array:
    """How far (n,) the z axes of bodies point up, times the square of the quaternions' length."""
    x, y, z, w = poses[:, 3:].T
    return np.asarray(w**2 + z**2 - x**2 - y**2)


def _turns(up: str, count: int) -> Array:
    return np.tile([0.0, 0.0, 0.0, *_TURNS[up]], (count, 1))
