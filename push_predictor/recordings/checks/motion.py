# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Motion of slider and tip on one time axis, and the samples in contact."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.recordings.dropouts import longest_interval
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.windows.contact import LONGEST_BREAK
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.recordings.windows.regular_stamps import SD
from push_predictor.types import Array, BoolArray, IntArray

# s before and after a sample that determine its speed: the first that noise allows
SPANS = (0.05, 0.07, 0.1, 0.14, 0.2, 0.28, 0.4)
MOVING_SHARE, MOVING = 0.4, 0.01  # of the lowered tip's speed; m/s: the noise of a slider's speed is to be smaller
NOISE = 7.0  # standard deviations of the speed of a slider at rest: what is faster moves
STEADY, STEADY_TIP = 0.5, 0.3  # change of velocity, as a share of it, of a slider and a tip that neither hit nor part
FEWEST = 5  # samples of each stream
LEAST_STEADY = 0.7  # share of the contact without its begin and end, from which on those distort no robust fit


@dataclass(frozen=True, eq=False)
class Motion:
    """n samples at the slider's stamps.

    time (n,) s; slider (n, 3): x, y m, heading rad, unwrapped; tip (n, 2) m; tip_height (n,) m above its lowest place;
    tip_velocity (n, 2) and tip_speed (n,) m/s, means over SPANS[0] on both sides; force (n, 2) N on the tip, NaN if
    unknown. moving (n,): whether the slider moves; contact (n,): it moves, and so does the lowered tip; steady (n,): in
    contact and neither begins nor ends to move, so that the tip is at the outline. push (n,): number of the contact.
    noise: standard deviation (m) of the outline's place in one sample, by the tracker's noise. span: s around a
    sample, on both sides, that determine the slider's speed. tool (n,): heading of the tip's frame, rad, unwrapped.
    """

    time: Array
    slider: Array
    tip: Array
    tip_height: Array
    tip_velocity: Array
    tip_speed: Array
    force: Array
    moving: BoolArray
    contact: BoolArray
    steady: BoolArray
    push: IntArray
    noise: float = 0.0
    span: float = SPANS[0]
    tool: Array | None = None

    @property
    def touching(self) -> BoolArray:
        """Which samples (n,) are in contact: without begin and end where fast pushes, or noise, leave those vague."""
        steady, contact = int(np.sum(self.steady)), int(np.sum(self.contact))
        vague = self.span > SPANS[0] or steady < LEAST_STEADY * contact
        return self.steady if vague and steady >= FEWEST else self.contact


def motion_of(recording: Recording, rig: Rig) -> Motion | None:
    """The motion of a recording, None if slider and tip have no common time."""
    slider, pusher = recording.slider, recording.pusher
    if min(len(slider), len(pusher)) < FEWEST:
        return None
    origin = slider.stamp[0]
    time, body = in_time(slider.stamp, origin, slider.x, slider.y, np.unwrap(slider.heading), slider.z)
    tip_time, tracked = in_time(pusher.stamp, origin, pusher.x, pusher.y, pusher.z, pusher.heading)
    within = (time >= tip_time[0]) & (time <= tip_time[-1])
    time, pose, height = time[within], body[within, :3], body[within, 3]
    if len(time) < FEWEST:
        return None
    tip = values_at(time, tip_time, tracked[:, :3])
    tool = np.interp(time, tip_time, np.unwrap(tracked[:, 3]))
    tip_velocity, options = mean_velocity(time, tip[:, :2], SPANS[0]), WindowOptions()
    tip_speed = np.hypot(*tip_velocity.T)
    lowered = tip[:, 2] - height < options.lift
    pushing = tip_speed[lowered & (tip_speed > options.least_speed)]
    slowest = MOVING_SHARE * float(np.median(pushing)) if len(pushing) else MOVING
    moving, steady, span = slider_motion(time, pose, rig, slowest)
    contact = moving & lowered & (tip_speed > options.least_speed)
    steady = contact & steady & _is_steady(*_halves(time, tip[:, :2], SPANS[0]), STEADY_TIP)
    force = _force(recording, origin, time)
    noise = float(np.hypot(np.max(noise_of(pose[:, :2])), np.sqrt(rig.outline.polar_moment) * noise_of(pose)[2]))
    raised, number = tip[:, 2] - np.nanmin(tip[:, 2]), _number(time, contact)
    measured = (time, pose, tip[:, :2], raised, tip_velocity, tip_speed, force)
    return Motion(*measured, moving, contact, steady, number, noise, span, tool)


def body_velocity(motion: Motion) -> Array:
    """Velocities (n, 2) of the tip, m/s, along the slider's axes."""
    return rotate(motion.tip_velocity, -motion.slider[:, 2])


def sums_by_push(values: Array, push: IntArray) -> Array:
    """Sums (m, k) of n rows of values (n, k) over each of the m pushes with numbers (n,)."""
    number = np.unique(push, return_inverse=True)[1]
    return np.column_stack([np.bincount(number, column) for column in values.T])


def _number(time: Array, contact: BoolArray) -> IntArray:
    """A contact after a pause is another push."""
    number = np.zeros(len(time), dtype=np.int64)
    if contact.any():
        number[contact] = np.cumsum(np.diff(time[contact], prepend=-np.inf) > WindowOptions().push_pause)
    return number


def in_time(stamp: IntArray, origin: int, *columns: Array) -> tuple[Array, Array]:
    """Increasing times (m,) s after an origin (ns), and the values (m, k) there of columns (n,) with stamps (n,) ns."""
    stamp, rows = np.unique(stamp, return_index=True)
    return np.asarray(1e-9 * (stamp - origin)), np.column_stack(columns)[rows]


def values_at(time: Array, known: Array, values: Array) -> Array:
    """Values (n, k) at times (n,) s, between those (m, k) known at times (m,) s."""
    return np.column_stack([np.interp(time, known, column) for column in values.T])


def mean_velocity(time: Array, values: Array, span: float) -> Array:
    """Mean velocities (n, k) from a span (s) before to one after each sample."""
    before, after = np.maximum(time - span, time[0]), np.minimum(time + span, time[-1])
    return np.asarray((values_at(after, time, values) - values_at(before, time, values)) / (after - before)[:, None])


def _halves(time: Array, values: Array, span: float) -> tuple[Array, Array]:
    """Mean velocities (n, k) in a span (s) before, and in one after each sample."""
    before, after = values_at(time - span, time, values), values_at(time + span, time, values)
    return (values - before) / span, (after - values) / span


def _is_steady(before: Array, after: Array, share: float, noise: float = 0.0) -> BoolArray:
    """Whether velocities (n, k) differ by less than a share of the larger one, and the noise (m/s) of their change."""
    largest = np.maximum(np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1))
    return np.asarray(np.linalg.norm(after - before, axis=1) < share * largest + noise)


def slider_motion(time: Array, pose: Array, rig: Rig, wanted: float = MOVING) -> tuple[BoolArray, BoolArray, float]:
    """Which samples (n,) of a slider move, which move steadily, and the span (s) on both sides that shows it.

    time (n,) s, pose (n, 3): x, y m, heading rad, unwrapped: turns count at the outline. wanted: speed (m/s) that noise
    is not to hide.
    """
    place = pose * [1.0, 1.0, np.sqrt(rig.outline.polar_moment)]
    wanted = min(wanted, MOVING)
    span = next((span for span in SPANS if NOISE * _speed_noise(place, span) < wanted), SPANS[-1])
    noise = _speed_noise(place, span)
    least = max(NOISE * noise, WindowOptions().least_speed)
    moving = np.linalg.norm(mean_velocity(time, place, span), axis=1) > least
    before, after = _halves(time, place, span)
    both = np.minimum(np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)) > least
    return moving, moving & both & _is_steady(before, after, STEADY, NOISE * noise), span


def noise_of(values: Array, order: int = 2) -> Array:
    """Standard deviations (k,) of the noise of n > order samples (n, k), from their differences of this order."""
    changes = np.abs(np.diff(values, order, axis=0))
    return np.asarray(SD * np.median(changes, axis=0) / np.sqrt(comb(2 * order, order)))


def _speed_noise(values: Array, span: float) -> float:
    """Standard deviation (m/s) of the speed at rest of n samples (n, k), m."""
    return float(np.max(noise_of(values)) * np.sqrt(2.0) / (2.0 * span))


def _force(recording: Recording, origin: int, time: Array) -> Array:
    """The force (n, 2) at times (n,) s, NaN where its samples are missing for longer than LONGEST_BREAK."""
    wrench = recording.wrench
    if wrench is None or len(wrench) < FEWEST:
        return np.full((len(time), 2), np.nan)
    known, force = in_time(wrench.stamp, origin, wrench.fx, wrench.fy)
    force = values_at(time, known, force)
    around = np.concatenate([[-np.inf], known, [np.inf]])
    after = np.searchsorted(around, time)
    missing = around[after] - around[after - 1] > LONGEST_BREAK
    near = np.minimum(np.abs(time - known[0]), np.abs(time - known[-1])) < longest_interval(
        float(np.median(np.diff(known)))
    )
    return np.asarray(np.where((missing & ~near)[:, None], np.nan, force))
