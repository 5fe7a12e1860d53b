# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Forces of the MLab rig, transformed from sensor axes to the world (MLab_EXP, ExtractFromLog.m)."""

from __future__ import annotations

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.recordings.importers.cleaning import twist
from push_predictor.types import Array

SENSOR_TO_TOOL = np.array([[1.0, 1.0], [1.0, -1.0]]) / np.sqrt(2.0)  # seen from below: a reflection
TARE_SAMPLES = 10


def contact_force(force: Array, robot: Array) -> Array:
    """Mean force (2,) N of the finger on the object in the world in the second half of a push.

    NaN if unknown. force: (n, 3) of t, fx, fy as logged. robot: (m, 8) of t, x, y, z, qw, qx, qy, qz.
    """
    if len(force) <= 2 * TARE_SAMPLES:
        return np.full(2, np.nan)
    return np.asarray(force_samples(force, robot)[len(force) // 2 :].mean(axis=0))


def force_samples(force: Array, robot: Array) -> Array:
    """Force (n, 2) N of the finger on the object in the world, relative to the first samples; as `contact_force`."""
    qw, _, _, qz = np.median(robot[:, 4:], axis=0)
    pressed = force[:, 1:] - force[:TARE_SAMPLES, 1:].mean(axis=0)
    return rotate(-pressed @ SENSOR_TO_TOOL.T, twist(qz, qw))
