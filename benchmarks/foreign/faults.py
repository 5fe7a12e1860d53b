# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Faults of measurement: clocks, frames, tool and force sensor of the new recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.support.plane import Array, direction, rotate


@dataclass(frozen=True)
class Fault:
    """A fault of `value` (s, rad, m or N by kind) along `axis` (rad, world) from `since` s of the recording on."""

    kind: str
    value: float
    axis: float = 0.0
    since: float = -np.inf

    def size(self, time: Array) -> Array:
        """The fault's value at each instant."""
        return np.where(time >= self.since, self.value, 0.0)

    def vector(self, time: Array) -> Array:
        """The fault as a vector along its axis."""
        return np.asarray(self.size(time)[:, None] * direction(np.array(self.axis)))


def clock_lag(faults: Sequence[Fault], time: Array) -> Array:
    """By how much the tracker's stamps are late, s."""
    lag = np.zeros(len(time))
    for fault in faults:
        if fault.kind == "clock_offset":
            lag = lag + fault.size(time)
    return lag


def tracked(faults: Sequence[Fault], time: Array, pose: Array) -> Array:
    """Slider poses as seen by a tracker whose frame is turned or shifted."""
    place, heading = pose[:, :2], pose[:, 2]
    for fault in faults:
        if fault.kind == "frame_rotation":
            place, heading = rotate(place, fault.size(time)), heading + fault.size(time)
        if fault.kind == "frame_shift":
            place = place + fault.vector(time)
    return np.column_stack([place, heading])


def reported(faults: Sequence[Fault], time: Array, tip: Array) -> Array:
    """Tip positions as reported with a wrong tool length."""
    for fault in faults:
        if fault.kind == "tool_offset":
            tip = tip + np.column_stack([fault.vector(time), np.zeros(len(time))])
    return tip


def biased(faults: Sequence[Fault], time: Array, force: Array) -> Array:
    """Forces of a sensor with a bias, N."""
    for fault in faults:
        if fault.kind == "wrench_bias":
            force = force + np.column_stack([fault.vector(time), np.zeros(len(time))])
    return force
