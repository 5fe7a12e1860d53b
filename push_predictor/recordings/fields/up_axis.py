# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Poses and wrenches of a world whose up axis is not z, turned into one whose z axis points up.

The world is turned about a horizontal axis: y up about x, x up about y, z down about x by half a turn. So the headings
of two worlds that differ in their up axis may differ by a constant.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from push_predictor.recordings.fields.pose_rows import composed, in_world_axes, inverted
from push_predictor.types import Array

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
