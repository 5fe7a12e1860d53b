# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Motion of slider and tip on one time axis, and the samples in contact, found without the outline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.types import Array, BoolArray, IntArray

SPAN = 0.05  # s before and after a sample that determine its speed
MOVING = 0.003  # m/s: a faster slider moves, whatever the tracker's noise
NOISE = 6.0  # standard deviations of the speed of a slider at rest: what is faster moves
FEWEST = 5  # samples of each stream


@dataclass(frozen=True, eq=False)
class Motion:
    """n samples at the slider's stamps.

    time (n,) s; slider (n, 3): x, y m, heading rad, unwrapped; tip (n, 2) m; tip_height (n,) m above its lowest place;
    tip_velocity (n, 2) m/s; slider_speed (n,) and tip_speed (n,) m/s, means over SPAN on both sides; force (n, 2) N on
    the tip, NaN if unknown. moving (n,): whether the slider moves; contact (n,): it moves, and so does the lowered tip.
    push (n,): number of the contact.
    """

    time: Array
    slider: Array
    tip: Array
    tip_height: Array
    tip_velocity: Array
    slider_speed: Array
    tip_speed: Array
    force: Array
    moving: BoolArray
    contact: BoolArray
    push: IntArray


def motion_of(recording: Recording, rig: Rig) -> Motion | None:
    """The motion of a recording, None if slider and tip have no common time."""
    slider, pusher = recording.slider, recording.pusher
    if min(len(slider), len(pusher)) < FEWEST:
        return None
    origin = slider.stamp[0]
    time, tip_time = _seconds(slider.stamp, origin), _seconds(pusher.stamp, origin)
    order, tip_order = np.unique(time, return_index=True)[1], np.unique(tip_time, return_index=True)[1]
    within = (time[order] >= tip_time.min()) & (time[order] <= tip_time.max())
    order = order[within]
    if len(order) < FEWEST:
        return None
    time = time[order]
    pose = np.column_stack([slider.x, slider.y, np.unwrap(slider.heading)])[order]
    tip = _at(time, tip_time[tip_order], np.column_stack([pusher.x, pusher.y, pusher.z])[tip_order])
    velocity, turn = _velocity(time, pose), np.sqrt(rig.outline.polar_moment)
    tip_velocity = _velocity(time, tip[:, :2])
    speed = np.hypot(np.hypot(velocity[:, 0], velocity[:, 1]), turn * velocity[:, 2])
    tip_speed, options = np.hypot(*tip_velocity.T), WindowOptions()
    lowered = tip[:, 2] - slider.z[order] < options.lift
    moving = speed > np.clip(NOISE * _speed_noise(pose * [1.0, 1.0, turn]), options.least_speed, MOVING)
    contact = moving & lowered & (tip_speed > options.least_speed)
    force = _force(recording, origin, time)
    height, number = tip[:, 2] - np.nanmin(tip[:, 2]), _number(time, contact)
    return Motion(time, pose, tip[:, :2], height, tip_velocity, speed, tip_speed, force, moving, contact, number)


def body_velocity(motion: Motion) -> Array:
    """Velocities (n, 2) of the tip, m/s, along the slider's axes."""
    return rotate(motion.tip_velocity, -motion.slider[:, 2])


def _number(time: Array, contact: BoolArray) -> IntArray:
    """A contact after a pause is another push."""
    number = np.zeros(len(time), dtype=np.int64)
    if contact.any():
        number[contact] = np.cumsum(np.diff(time[contact], prepend=-np.inf) > WindowOptions().push_pause)
    return number


def _seconds(stamp: IntArray, origin: int) -> Array:
    return np.asarray(1e-9 * (stamp - origin))


def _at(time: Array, known: Array, values: Array) -> Array:
    return np.column_stack([np.interp(time, known, column) for column in values.T])


def _velocity(time: Array, values: Array) -> Array:
    """Mean velocities (n, k) from SPAN before to SPAN after each sample."""
    before, after = np.maximum(time - SPAN, time[0]), np.minimum(time + SPAN, time[-1])
    return np.asarray((_at(after, time, values) - _at(before, time, values)) / (after - before)[:, None])


def _speed_noise(values: Array) -> float:
    """Standard deviation (m/s) of the speed at rest, from the second differences of n samples (n, k), m."""
    spread = 1.4826 * np.median(np.abs(np.diff(values, 2, axis=0)), axis=0) / np.sqrt(6.0)
    return float(np.max(spread) * np.sqrt(2.0) / (2.0 * SPAN))


def _force(recording: Recording, origin: int, time: Array) -> Array:
    wrench = recording.wrench
    if wrench is None or len(wrench) < FEWEST:
        return np.full((len(time), 2), np.nan)
    return _at(time, _seconds(wrench.stamp, origin), np.column_stack([wrench.fx, wrench.fy]))
