# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rules of a sample: which messages become samples of a stream, and why others are rejected."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from push_predictor.geometry.frames import tilt_of_quaternion, yaw_of_quaternion
from push_predictor.recordings.streams import PoseStream, WrenchStream
from push_predictor.types import Array, BoolArray, IntArray

SMALLEST_COMPONENT = 1e-6  # a quaternion without a larger component has no orientation
PLANAR_WRENCH = (0, 1, 5)  # columns of fx, fy and the torque about the vertical
UNREADABLE, OTHER_FRAME, NO_TRANSFORM = "unreadable", "frame_id", "without transform"
NO_ELEMENT = "without element"
NOT_FINITE, NO_ORIENTATION, OTHER_CLOCK = "not finite", "no orientation", "another clock"

Rules: TypeAlias = Mapping[str, Callable[[Array], BoolArray]]  # {fault: which of the numbers (n, k) have it}


def usable(faults: Mapping[str, BoolArray], rejected: Counter[str]) -> BoolArray:
    """Which of n samples have none of the faults; rejected: counts the others, each once, for its first fault."""
    found = ~np.zeros_like(next(iter(faults.values())))
    for fault, faulty in faults.items():
        if count := int(np.sum(found & faulty)):
            rejected[fault] += count
        found &= ~faulty
    return np.asarray(found)


def broken(values: Array, rules: Rules) -> dict[str, BoolArray]:
    """Which of n rows of numbers break each rule."""
    return {fault: test(values) for fault, test in rules.items()}


def has_orientation(values: Array) -> BoolArray:
    """Which poses (n, 7) have a usable quaternion, of any length."""
    largest = np.abs(values[:, 3:]).max(axis=1, initial=0.0)
    return np.asarray(np.isfinite(largest) & (largest > SMALLEST_COMPONENT))


def slider_stream(stamp: IntArray, values: Array) -> PoseStream:
    """The stream of poses (n, 7: x, y, z, quaternion) with orientation; quaternions are normalised."""
    quaternion = values[:, 3:] / np.abs(values[:, 3:]).max(axis=1, keepdims=True)
    unit = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
    x, y, z = values[:, :3].T.copy()
    return PoseStream(stamp, x, y, z, yaw_of_quaternion(*unit.T), tilt_of_quaternion(*unit.T))


def pusher_stream(stamp: IntArray, values: Array) -> PoseStream:
    """The stream of tip poses (n, 7); the tip is a point, so a missing orientation becomes heading 0."""
    oriented = has_orientation(values)
    return slider_stream(stamp, values if oriented.all() else np.where(oriented[:, None], values, upright(values)))


def upright(values: Array) -> Array:
    """Poses (n, 7) at the same positions with the identity as orientation."""
    return np.column_stack([values[:, :3], np.tile([0.0, 0.0, 0.0, 1.0], (len(values), 1))])


def wrench_stream(stamp: IntArray, values: Array) -> WrenchStream:
    """The stream of wrenches (n, 6: force, torque)."""
    return WrenchStream(stamp, *values[:, PLANAR_WRENCH].T.copy())


def _not_finite(values: Array) -> BoolArray:
    return np.asarray(~np.isfinite(values).all(axis=1))


SLIDER: Rules = MappingProxyType(
    {NOT_FINITE: _not_finite, NO_ORIENTATION: lambda values: np.asarray(~has_orientation(values))}
)
PUSHER: Rules = MappingProxyType({NOT_FINITE: lambda values: _not_finite(values[:, :3])})
WRENCH: Rules = MappingProxyType({NOT_FINITE: lambda values: _not_finite(values[:, PLANAR_WRENCH])})
# A wrench whose axes are turned needs all six numbers.
SPATIAL_WRENCH: Rules = MappingProxyType({NOT_FINITE: _not_finite})
SCALAR: Rules = MappingProxyType({NOT_FINITE: _not_finite})
