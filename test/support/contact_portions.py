# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Portions of contact samples, as the window finder judges them."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.windows.contact import ContactSamples


def samples_at(
    time: np.ndarray, gap: np.ndarray, force: np.ndarray, speed: np.ndarray, way: np.ndarray | None = None
) -> ContactSamples:
    """Samples (n,) of a slider that is way (m) along x, at rest without it; the force (N) is along x."""
    still, never = np.zeros(len(time)), np.zeros(len(time), dtype=np.bool_)
    return ContactSamples(
        stamp=np.rint(1e9 * time).astype(np.int64),
        time=time,
        place=np.column_stack([still if way is None else way, still]),
        gap=gap,
        height=still,
        closing_speed=still,
        opening_speed=still,
        force=np.column_stack([force, still]),
        speed=speed,
        at_speed=speed > 0.0,
        in_break=never,
        after_break=never,
        repositioned=never,
    )
