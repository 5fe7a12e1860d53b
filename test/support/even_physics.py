# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Physics without noise: uniform friction of the table, constant load and contact friction."""

from __future__ import annotations

import numpy as np

from push_predictor.simulation.physics import PushNoise
from push_predictor.simulation.surface import CELL, HALF_EXTENT, FrictionField


def uniform_field(friction: float) -> FrictionField:
    """The same friction everywhere on the table."""
    size = round(2.0 * HALF_EXTENT / CELL) + 1
    return FrictionField(np.full((size, size), friction))


def no_noise(n: int, k: int) -> PushNoise:
    """Deviations of n pushes that are zero, k wide."""
    return PushNoise(np.zeros((n, k)), np.zeros((n, 2, k)))
