# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Motion of slider and tip on one time axis, the samples in contact, and how well these lie on the rig's outline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, to_body
from push_predictor.recordings.checks.coverage import sides_of
from push_predictor.recordings.dropouts import longest_interval
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.contact import LONGEST_BREAK
from push_predictor.recordings.windows.push_window import WindowOptions
from push_predictor.recordings.windows.regular_stamps import SD
from push_predictor.types import Array, BoolArray, IntArray

SPAN = 0.05  # s before and after a sample that determine its speed
MOVING = 0.003  # m/s: a faster slider moves, whatever the tracker's noise
NOISE = 7.0  # standard deviations of the speed of a slider at rest: what is faster moves
FEWEST = 5  # samples of each stream
OFF = 0.001  # m from the outline


@dataclass(frozen=True, eq=False)
class Motion:
    """n samples at the slider's stamps.

    time (n,) s; slider (n, 3): x, y m, heading rad, unwrapped; tip (n, 2) m; tip_height (n,) m above its lowest place;
    tip_velocity (n, 2) and tip_speed (n,) m/s, means over SPAN on both sides; force (n, 2) N on the tip, NaN if
    unknown. moving (n,): whether the slider moves; contact (n,): it moves, and so does the lowered tip. push (n,):
    number of the contact.
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
    push: IntArray


@dataclass(frozen=True)
class ContactFit:
    """The contacts of a recording against the outline of its rig, as given.

    samples: in contact, judged by motion alone. inside, off: shares of them with the tip over OFF inside the outline,
    or away from it. side: "side" or "quarter"; gaps: median gap (m, negative inside) on each, counter-clockwise from
    the first vertex, None without a contact. contact_time, window_time: s in contact, and in windows; the latter None
    where no windows were searched for.
    """

    samples: int
    inside: float
    off: float
    side: str
    gaps: tuple[float | None, ...]
    contact_time: float
    window_time: float | None

    @property
    def lost(self) -> float | None:
        """Share of the time in contact that is in no window, None where no windows were searched for."""
        if self.window_time is None:
            return None
        return max(0.0, 1.0 - self.window_time / self.contact_time)

    def record(self) -> dict[str, object]:
        """The entry in the JSON."""
        return {
            "samples": self.samples,
            "inside_share": self.inside,
            "off_share": self.off,
            "gap_by_side": list(self.gaps),
            "contact_time": self.contact_time,
            "window_time": self.window_time,
            "lost_share": self.lost,
        }


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
    return Motion(time, pose, tip[:, :2], height, tip_velocity, tip_speed, force, moving, contact, number)


def body_velocity(motion: Motion) -> Array:
    """Velocities (n, 2) of the tip, m/s, along the slider's axes."""
    return rotate(motion.tip_velocity, -motion.slider[:, 2])


def sums_by_push(values: Array, push: IntArray) -> Array:
    """Sums (m, k) of n rows of values (n, k) over each of the m pushes with numbers (n,)."""
    number = np.unique(push, return_inverse=True)[1]
    return np.column_stack([np.bincount(number, column) for column in values.T])


def contact_fit(recording: Recording, rig: Rig, table: PushTable | None = None) -> ContactFit | None:
    """The fit of a recording's contacts, None without one. table: of its windows, tiled end to end."""
    motion = motion_of(recording, rig)
    if motion is None or not motion.contact.any():
        return None
    touch = motion.contact
    nearest = rig.outline.project(to_body(motion.tip, motion.slider)[touch])
    gap, (index, count, side) = nearest.distance - rig.pusher_radius, sides_of(rig.outline, nearest.contact)
    gaps = [float(np.median(gap[index == k])) if np.any(index == k) else None for k in range(count)]
    return ContactFit(
        samples=int(np.sum(touch)),
        inside=float(np.mean(gap < -OFF)),
        off=float(np.mean(gap > OFF)),
        side=side,
        gaps=tuple(gaps),
        contact_time=_contact_time(motion),
        window_time=None if table is None else float(np.sum(table.duration)),
    )


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
    spread = SD * np.median(np.abs(np.diff(values, 2, axis=0)), axis=0) / np.sqrt(6.0)
    return float(np.max(spread) * np.sqrt(2.0) / (2.0 * SPAN))


def _force(recording: Recording, origin: int, time: Array) -> Array:
    """The force (n, 2) at times (n,) s, NaN where its samples are missing for longer than LONGEST_BREAK."""
    wrench = recording.wrench
    if wrench is None or len(wrench) < FEWEST:
        return np.full((len(time), 2), np.nan)
    stamp, rows = np.unique(wrench.stamp, return_index=True)
    known = _seconds(stamp, origin)
    force = _at(time, known, np.column_stack([wrench.fx, wrench.fy])[rows])
    around = np.concatenate([[-np.inf], known, [np.inf]])
    after = np.searchsorted(around, time)
    missing = around[after] - around[after - 1] > LONGEST_BREAK
    near = np.minimum(np.abs(time - known[0]), np.abs(time - known[-1])) < longest_interval(
        float(np.median(np.diff(known)))
    )
    return np.asarray(np.where((missing & ~near)[:, None], np.nan, force))


def _contact_time(motion: Motion) -> float:
    """Time (s) from samples in contact to the next ones, without dropouts."""
    step = np.diff(motion.time)
    period = float(np.median(step))
    step = np.append(np.where(step > longest_interval(period), period, step), period)
    return float(np.sum(step[motion.contact]))
