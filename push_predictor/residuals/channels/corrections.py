# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Correct a measurement error in the stream where it occurred, so that the windows can be cut again.

The tracker's stream is moved to the robot's frame and clock, in which the pusher, the contact and the push frame are
expressed. A tool offset is subtracted from the pusher's stream, a bias from the wrench. A push table contains no
streams, so its windows cannot be cut again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from push_predictor.geometry.frames import rotate, wrap_angle
from push_predictor.recordings.streams import PoseStream, Recording


def correct(recording: Recording, mechanism: str, values: Sequence[float]) -> Recording:
    """The recording without a measurement error; values: its parameters, as in MeasurementFault.values.

    clock_offset (s): the slider's stamps are late. frame_rotation (rad): the slider appears rotated about the world's
    origin. frame_shift (m, m): the slider appears shifted. tool_offset (m, m): the pusher appears shifted. wrench_bias
    (N, N): the sensor reads too much, in world axes. Raises KeyError for another mechanism.
    """
    corrected = CORRECTIONS[mechanism](recording, *values)
    sizes = ", ".join(f"{value:.3g}" for value in values)
    return replace(corrected, notes=(*recording.notes, f"corrected for {mechanism} ({sizes})"))


def _clock(recording: Recording, lateness: float) -> Recording:
    slider = recording.slider
    return replace(recording, slider=replace(slider, stamp=slider.stamp - round(lateness * 1e9)))


def _rotation(recording: Recording, turn: float) -> Recording:
    slider = recording.slider
    place = rotate(np.column_stack([slider.x, slider.y]), np.array(-turn))
    heading = wrap_angle(slider.heading - turn)
    return replace(recording, slider=replace(slider, x=place[:, 0], y=place[:, 1], heading=heading))


def _shift(recording: Recording, x: float, y: float) -> Recording:
    return replace(recording, slider=_moved(recording.slider, -x, -y))


def _tool(recording: Recording, x: float, y: float) -> Recording:
    return replace(recording, pusher=_moved(recording.pusher, -x, -y))


def _bias(recording: Recording, x: float, y: float) -> Recording:
    wrench = recording.wrench
    if wrench is None:
        return recording
    return replace(recording, wrench=replace(wrench, fx=wrench.fx - x, fy=wrench.fy - y))


def _moved(stream: PoseStream, x: float, y: float) -> PoseStream:
    return replace(stream, x=stream.x + x, y=stream.y + y)


CORRECTIONS: dict[str, Callable[..., Recording]] = {
    "clock_offset": _clock,
    "frame_rotation": _rotation,
    "frame_shift": _shift,
    "tool_offset": _tool,
    "wrench_bias": _bias,
}
