# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The outcomes of pushes as a model sees them, without sensor noise: how much a hidden change moves them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.foreign.faults import Fault, clock_lag, tracked
from benchmarks.foreign.motion import PushMotion
from benchmarks.foreign.rig import Rig
from benchmarks.support.plane import Array, rotate

WINDOW = 0.2  # s


def outcomes(rig: Rig, motion: PushMotion, touch: Array, faults: Sequence[Fault]) -> Array:
    """Displacements (dx, dy, dtheta) of all windows of all pushes, without sensor noise, shape (windows, 3)."""
    rows = []
    for push in range(len(touch)):
        stamps = np.arange(0.0, motion.time[push, -1], WINDOW)
        seen = stamps - rig.sensors.tracker_latency - clock_lag(faults, touch[push] + stamps)
        pose = np.stack([np.interp(seen, motion.time[push], values) for values in motion.pose[push].T], axis=-1)
        step = np.diff(tracked(faults, touch[push] + stamps, pose), axis=0)
        step[:, :2] = rotate(step[:, :2], np.full(len(step), -motion.heading[push]))
        rows.append(step)
    return np.concatenate(rows)
