# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A correction takes back what the measurement error did to the stream, and leaves the other streams alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
import pytest

from push_predictor.geometry.frames import rotate
from push_predictor.recordings.streams import Recording
from push_predictor.residuals.channels.measurement import CORRECTIONS, correct


def late(r: Recording) -> Recording:
    return replace(r, slider=replace(r.slider, stamp=r.slider.stamp + 12_000_000))


def turned(r: Recording) -> Recording:
    x, y = rotate(np.column_stack([r.slider.x, r.slider.y]), np.array(0.2)).T
    return replace(r, slider=replace(r.slider, x=x, y=y, heading=r.slider.heading + 0.2))


def moved(r: Recording) -> Recording:
    return replace(r, slider=replace(r.slider, x=r.slider.x + 0.003, y=r.slider.y - 0.001))


def offset(r: Recording) -> Recording:
    return replace(r, pusher=replace(r.pusher, x=r.pusher.x + 0.002, y=r.pusher.y + 0.004))


def biased(r: Recording) -> Recording:
    assert r.wrench is not None
    return replace(r, wrench=replace(r.wrench, fx=r.wrench.fx + 0.4, fy=r.wrench.fy - 0.3))


FAULTS: dict[str, tuple[Callable[[Recording], Recording], tuple[float, ...]]] = {
    "clock_offset": (late, (0.012,)),
    "frame_rotation": (turned, (0.2,)),
    "frame_shift": (moved, (0.003, -0.001)),
    "tool_offset": (offset, (0.002, 0.004)),
    "wrench_bias": (biased, (0.4, -0.3)),
}


@pytest.mark.parametrize("mechanism", CORRECTIONS)
def test_the_corrected_recording_is_the_one_without_the_error(mechanism: str, recording: Recording) -> None:
    fault, values = FAULTS[mechanism]
    corrected = correct(fault(recording), mechanism, values)
    for name in ("slider", "pusher", "wrench"):
        found, expected = getattr(corrected, name), getattr(recording, name)
        for field in fields(expected):
            if getattr(expected, field.name) is not None:
                assert np.allclose(getattr(found, field.name), getattr(expected, field.name), rtol=0.0, atol=1e-12)
    assert mechanism in corrected.notes[-1]


def test_a_bias_of_an_absent_wrench_changes_nothing(recording: Recording) -> None:
    bare = replace(recording, wrench=None)
    assert correct(bare, "wrench_bias", (0.4, -0.3)).wrench is None
