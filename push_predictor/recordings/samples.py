# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The rules of a sample: which messages become samples of a stream, which are rejected, and why.

Reading a recording and listening to live topics both apply these rules, so they get the same samples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from push_predictor.geometry.frames import tilt_of_quaternion, yaw_of_quaternion
from push_predictor.recordings.bag.cdr import POSE_STAMPED, WRENCH_STAMPED, Layout, decode, frame_of
from push_predictor.recordings.bag.definitions import SCALAR_LAYOUTS
from push_predictor.recordings.streams import PoseStream, WrenchStream
from push_predictor.types import Array, BoolArray, IntArray

SMALLEST_COMPONENT = 1e-6  # a quaternion without a larger component has no orientation
PLANAR_WRENCH = (0, 1, 5)  # columns of fx, fy and the torque about the vertical
UNREADABLE, OTHER_FRAME = "unreadable", "frame_id"
NOT_FINITE, NO_ORIENTATION = "not finite", "no orientation"


@dataclass(frozen=True)
class SampleRules:
    """The layout of a sensor's messages and the faults for which a sample is rejected.

    faults: {fault: test}; a test takes the numbers (n, k) of n messages and returns which of them (n,) are faulty.
    """

    layout: Layout
    faults: Mapping[str, Callable[[Array], BoolArray]]


@dataclass(frozen=True, eq=False)
class CheckedSamples:
    """n decoded messages.

    stamp (n,) in ns, values (n, k), usable (n,), rejected {fault: count}, frames: the frame_ids found.
    """

    stamp: IntArray
    values: Array
    usable: BoolArray
    rejected: dict[str, int]
    frames: frozenset[str]


class UsableSamples(NamedTuple):
    """n samples that no rule rejects: topic, stamp (n,) in ns, values (n, k), and the frame_ids of their topic."""

    topic: str
    stamp: IntArray
    values: Array
    frames: frozenset[str]


def check_samples(messages: Sequence[bytes], rules: SampleRules, frame_id: str = "") -> CheckedSamples:
    """Decode messages and apply the rules; a message with several faults counts once, for the first.

    frame_id: the frame that headers must name, empty for any.
    """
    columns = decode(messages, rules.layout)
    faults = {UNREADABLE: ~columns.valid}
    if frame_id and columns.frames - {frame_id}:
        faults[OTHER_FRAME] = np.array([frame_of(message) != frame_id for message in messages], dtype=np.bool_)
    faults |= {fault: test(columns.values) for fault, test in rules.faults.items()}
    usable, rejected = np.ones(len(messages), dtype=np.bool_), {}
    for fault, faulty in faults.items():
        if count := int(np.sum(usable & faulty)):
            rejected[fault] = count
        usable &= ~faulty
    return CheckedSamples(columns.stamp, columns.values, usable, rejected, columns.frames)


def scalar_rules(message_type: str) -> SampleRules:
    """The rules of a scalar topic of one of the types in SCALAR_LAYOUTS."""
    return SampleRules(SCALAR_LAYOUTS[message_type], {NOT_FINITE: lambda rows: _not_finite(rows[:, :1])})


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
    return slider_stream(stamp, np.where(has_orientation(values)[:, None], values, upright(values)))


def upright(values: Array) -> Array:
    """Poses (n, 7) at the same positions with the identity as orientation."""
    return np.column_stack([values[:, :3], np.tile([0.0, 0.0, 0.0, 1.0], (len(values), 1))])


def wrench_stream(stamp: IntArray, values: Array) -> WrenchStream:
    """The stream of wrenches (n, 6: force, torque)."""
    return WrenchStream(stamp, *values[:, PLANAR_WRENCH].T.copy())


def _not_finite(values: Array) -> BoolArray:
    return np.asarray(~np.isfinite(values).all(axis=1))


SLIDER = SampleRules(
    POSE_STAMPED, {NOT_FINITE: _not_finite, NO_ORIENTATION: lambda values: np.asarray(~has_orientation(values))}
)
PUSHER = SampleRules(POSE_STAMPED, {NOT_FINITE: lambda values: _not_finite(values[:, :3])})
WRENCH = SampleRules(WRENCH_STAMPED, {NOT_FINITE: lambda values: _not_finite(values[:, PLANAR_WRENCH])})
# A wrench whose axes are turned needs all six numbers.
SPATIAL_WRENCH = SampleRules(WRENCH_STAMPED, {NOT_FINITE: _not_finite})
