# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Lengths in millimetres, angles in degrees, times in milliseconds."""

from __future__ import annotations

import numpy as np

from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.frames.orientation import OUTRUN, STEEP, TRAVEL, every, tilt_of, turn_and_path
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import PoseStream, Recording
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

FASTEST = 2.0  # m/s of a pusher
LARGEST = 2.0  # m: reach of a slider
HIGHEST_RATE = 20e3  # Hz of samples
LOWEST_RATE = 1.0  # Hz
LONGEST = 30.0  # s of a table's row
SPEED_SPAN = 0.1  # s between the poses whose speed is judged
PUSHER_MM = "Give positions in metres: divide by 1000."


def stream_rates(recording: Recording) -> list[Finding]:
    """Findings about the unit of the stamps."""
    streams = (("slider", recording.slider), ("pusher", recording.pusher))
    found = [_rate(name, stream) for name, stream in streams if len(stream) > 2]
    return [finding for finding in found if finding is not None]


def stream_units(recording: Recording, rig: Rig) -> list[Finding]:
    """Findings about the units of lengths and angles of a recording's streams and rig."""
    found = [_rig_length(rig)]
    found += [
        _speed(name, stream)
        for name, stream in (("slider", recording.slider), ("pusher", recording.pusher))
        if len(stream) > 2
    ]
    if not any(found) and tilt_of(recording.slider) <= STEEP:  # of a steep z axis, headings may be anything
        found.append(_turning(recording.slider, rig))
    return [finding for finding in found if finding is not None]


def table_units(table: PushTable, rig: Rig | None = None) -> list[Finding]:
    """Findings about the units of a table's columns."""
    velocity, path = table.inputs[:, 0], table.inputs[:, 0] * table.duration
    shift, turn = np.hypot(table.outcomes[:, 0], table.outcomes[:, 1]), np.abs(table.outcomes[:, 2])
    found = [] if rig is None else [_rig_length(rig)]
    if len(table):
        found += [
            _column("velocity", "mm/s", np.median(velocity), FASTEST, "m/s"),
            _column("duration", "ms", np.median(table.duration), LONGEST, "s"),
            _column("dtheta", "degrees", np.percentile(turn, 99.0), np.pi, "rad"),
        ]
        if not any(found):
            ratio = float(np.median(shift / np.maximum(path, 1e-9)))
            found.append(_column("dx and dy", "mm", ratio, OUTRUN, "path lengths of the tip"))
    return [finding for finding in found if finding is not None]


def _column(name: str, unit: str, value: float, most: float, of: str) -> Finding | None:
    if value <= most:
        return None
    sentence = f"{name} reaches {value:.4g} {of}, more than {most:.3g}: the unit is probably {unit}."
    return Finding(
        f"units_{name.split()[0]}", "refused", sentence, "Give m, rad and s.", {name: Value(float(value), of)}
    )


def _rig_length(rig: Rig) -> Finding | None:
    size = rig.outline.reach
    if max(size, rig.pusher_radius) < LARGEST:
        return None
    sentence = f"The rig's outline reaches {size:.4g} m, the tip radius is {rig.pusher_radius:.4g} m: probably mm."
    return Finding("units_rig", "refused", sentence, "Give the rig's lengths in metres.", {"reach": Value(size, "m")})


def _rate(name: str, stream: PoseStream) -> Finding | None:
    step = np.diff(stream.stamp)
    if not np.any(step > 0):
        return None
    rate = 1.0 / (1e-9 * float(np.median(step[step > 0])))  # a sample that was sent twice adds none
    if LOWEST_RATE <= rate <= HIGHEST_RATE:
        return None
    sentence = f"The {name}'s stamps give {rate:.3g} samples a second: the unit of the stamps is probably ms or us."
    return Finding(
        f"units_time_{name}",
        "refused",
        sentence,
        "Give stamps in seconds and nanoseconds.",
        {"rate": Value(rate, "Hz")},
    )


def _speed(name: str, stream: PoseStream) -> Finding | None:
    """Of the steps that contain half of the path: a few tracking errors, or long rests, do not matter.

    Steps of SPEED_SPAN: between two samples, stamps of receipt and poses of a slower source show no speed.
    """
    rows = every(stream, SPEED_SPAN)
    step, time = np.hypot(np.diff(stream.x[rows]), np.diff(stream.y[rows])), 1e-9 * np.diff(stream.stamp[rows])
    known = np.isfinite(step) & (time > 0.0)
    if not known.any():
        return None
    speed = _weighted_median(step[known] / time[known], step[known])
    if speed <= FASTEST:
        return None
    sentence = f"The {name} moves at {speed:.3g} m/s, more than {FASTEST:.0f} m/s: its positions are probably in mm."
    return Finding(f"units_length_{name}", "refused", sentence, PUSHER_MM, {"speed": Value(speed, "m/s")})


def _turning(slider: PoseStream, rig: Rig) -> Finding | None:
    """A finding if the slider turns farther than a pushed one."""
    turn, path = turn_and_path(slider)
    if turn * rig.outline.reach <= OUTRUN * max(path, TRAVEL):
        return None
    sentence = f"The slider turns by {turn:.0f} rad over {path:.2f} m: its heading is probably in degrees."
    return Finding("units_heading", "refused", sentence, "Give headings in radians.", {"turn": Value(turn, "rad")})


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])
