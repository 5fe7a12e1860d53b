# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Scalar topics: temperature of the surface and humidity of the room, wandering slowly."""

from __future__ import annotations

import numpy as np

from benchmarks.foreign.rig import Rig
from benchmarks.foreign.session import Track

RATE = 2.0  # Hz


def draw_scalars(rng: np.random.Generator, rig: Rig, duration: float) -> dict[str, Track]:
    """Scalar signals of a session of `duration` s, by topic."""
    signals = {"/surface/temperature": _wandering(rng, duration, rig.warmth, 1.2)}
    if rig.humidity:
        signals["/room/humidity"] = _wandering(rng, duration, 45.0, 4.0)
    return signals


def _wandering(rng: np.random.Generator, duration: float, mean: float, deviation: float) -> Track:
    """A few slow waves, none of them so slow that the signal merely follows the time."""
    time = np.arange(0.0, duration, 1 / RATE)
    cycles = rng.uniform(1.5, 6.0, 4)
    waves = [np.sin(2 * np.pi * n * time / duration + rng.uniform(0, 2 * np.pi)) for n in cycles]
    signal = mean + deviation * np.sum(waves, axis=0) / np.sqrt(2)
    return Track(time, (signal + rng.normal(0, 0.02, len(time)))[:, None])
