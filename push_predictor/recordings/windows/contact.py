# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Contact at every slider sample: gap to the pusher, motion, force, and interruptions of the streams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import to_body
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.track import JUMP_DISTANCE, Track
from push_predictor.types import Array, BoolArray, IntArray

REACH = 0.1  # s of data after a sample that its evaluation needs
NEAR = 0.05  # s around a sample that determine motion and gap
FORWARD_SPAN = 0.03  # s after a sample in which the pusher must already move
FIT_SPAN = 0.020  # s of a window that determine its velocity and angle (docs/explanation/windows.md)
NEAR_SHARE, REACH_SHARE = 0.8, 0.5  # of the speed until NEAR, and from FIT_SPAN to REACH: slower is accelerating
MISSING_PERIODS = 2.5  # periods between samples of the force from which some are missing
SLOWEST = 0.05  # s between samples of the force: a slower one shows neither begin nor end of a contact
LONGEST_BREAK = 2.0  # s; after a longer break a contact counts as another push, and a force is unknown in one
SHORTEST_SPAN = 1e-3  # s; a shorter difference determines no speed


@dataclass(frozen=True, eq=False)
class ContactSamples:
    """A portion of n slider samples, in order.

    stamp (n,) ns, time (n,) s; place (n, 2) m of the slider; gap (n,) m between pusher and outline, height (n,) m of
    the tip above the slider. closing_speed (n,): rate at which the gap shrinks after the sample, m/s; opening_speed
    (n,): at which it grew before it, m/s. force (n, 2): measured, N, NaN if unknown. speed (n,): of the pusher, m/s,
    the smaller of the means around and after the sample. at_speed (n,): the pusher is not accelerating. in_break (n,):
    a stream has a break here; after_break (n,): one had a break since the previous sample; repositioned (n,): the
    slider was placed elsewhere since the previous sample.
    """

    stamp: IntArray
    time: Array
    place: Array
    gap: Array
    height: Array
    closing_speed: Array
    opening_speed: Array
    force: Array
    speed: Array
    at_speed: BoolArray
    in_break: BoolArray
    after_break: BoolArray
    repositioned: BoolArray

    def __len__(self) -> int:
        return len(self.stamp)

    @property
    def force_known(self) -> BoolArray:
        """Whether the force at the samples (n,) is known."""
        return ~np.isnan(self.force[:, 0])


def contact_samples(
    rig: Rig, slider: Track, pusher: Track, wrench: Track | None, first: int, last: int
) -> ContactSamples:
    """The contact at slider samples first to last - 1 (indices into the track)."""
    time = slider.time[first:last]
    tips = {span: pusher.at(time + span) for span in (0.0, -NEAR, FIT_SPAN, FORWARD_SPAN, NEAR, REACH)}
    before = slider.time[max(first - 1, 0) : last - 1] if first else np.append(time[0], time[:-1])
    absent = _absent(wrench, time)
    after_break, in_break = np.logical_or(slider.breaks_in(before, time), pusher.breaks_in(before, time))
    if wrench is not None:
        overlap, beyond = wrench.breaks_in(before, time)
        after_break, in_break = after_break | overlap & ~absent, in_break | beyond & ~absent
    gap, closing_speed, opening_speed = _gaps(rig, slider, pusher, first, last)
    around, after = (_speed(pusher, time, tips, *span) for span in ((-NEAR, NEAR), (0.0, FORWARD_SPAN)))
    return ContactSamples(
        stamp=slider.stamp[first:last],
        time=time,
        place=slider.values[first:last, :2],
        gap=gap,
        height=tips[0.0][:, 2] - slider.values[first:last, 2],
        closing_speed=closing_speed,
        opening_speed=opening_speed,
        force=_forces(wrench, time, absent),
        # A step of the resolution is no motion.
        speed=np.maximum(np.minimum(around, after) - pusher.resolution / (2.0 * NEAR), 0.0),
        at_speed=_at_speed(pusher, time, tips),
        in_break=in_break,
        after_break=after_break,
        repositioned=_repositioned(slider, pusher, first, last),
    )


def _at_speed(pusher: Track, time: Array, tips: dict[float, Array]) -> BoolArray:
    """Whether the tip is not accelerating at times (n,); True for a stream too slow to show it."""
    if 3.0 * pusher.period > FIT_SPAN:
        return np.ones(len(time), dtype=np.bool_)
    spans = ((0.0, FIT_SPAN), (0.0, NEAR), (FIT_SPAN, REACH))
    first, near, later = (_speed(pusher, time, tips, *span) for span in spans)
    return np.asarray((first >= NEAR_SHARE * near) & (first >= REACH_SHARE * later))


def _gaps(rig: Rig, slider: Track, pusher: Track, first: int, last: int) -> tuple[Array, Array, Array]:
    """Gap (n,) m at the samples, and rates (n,) m/s: it shrinks in the NEAR after each, and grew in that before."""
    begin = int(np.searchsorted(slider.time, slider.time[first] - NEAR))
    ahead = int(np.searchsorted(slider.time, slider.time[last - 1] + NEAR, side="right"))
    time, pose = slider.time[begin:ahead], slider.values[begin:ahead][:, [0, 1, 3]]
    gap = rig.outline.project(to_body(pusher.at(time)[:, :2], pose)).distance - rig.pusher_radius
    # Samples within NEAR, not interpolated values: the sample after it may not have arrived yet.
    later = np.searchsorted(time, time + NEAR, side="right") - 1
    closing_speed = (gap - gap[later]) / np.maximum(time[later] - time, SHORTEST_SPAN)
    earlier = np.searchsorted(time, time - NEAR)
    opening_speed = (gap - gap[earlier]) / np.maximum(time - time[earlier], SHORTEST_SPAN)
    rows = slice(first - begin, last - begin)
    return gap[rows], closing_speed[rows], opening_speed[rows]


def _absent(wrench: Track | None, time: Array) -> BoolArray:
    """Whether no force shows contacts at times (n,): its stream is slow, begins later, has ended, or has a long gap."""
    if wrench is None or wrench.period > SLOWEST:
        return np.ones(len(time), dtype=np.bool_)
    known = np.concatenate([[-np.inf], wrench.time, [np.inf]])
    after = np.searchsorted(known, time)
    at_ends = (time >= wrench.time[0] - wrench.longest_gap) & (time <= wrench.time[-1] + wrench.longest_gap)
    inside = (after > 1) & (after < len(known) - 1)
    return np.asarray((known[after] - known[after - 1] > LONGEST_BREAK) & (inside | ~at_ends))


def _forces(wrench: Track | None, time: Array, absent: BoolArray) -> Array:
    """Forces (n, 2) N; where samples are missing the last one before, as the touch may lie between it and the next."""
    if wrench is None:
        return np.full((len(time), 2), np.nan)
    last = len(wrench.time) - 1
    before = np.clip(np.searchsorted(wrench.time, time, side="right") - 1, 0, last)
    after = np.minimum(before + 1, last)
    missing = wrench.time[after] - wrench.time[before] > MISSING_PERIODS * wrench.period
    forces = np.where(missing[:, None], wrench.values[before], wrench.at(time))
    return np.asarray(np.where(absent[:, None], np.nan, forces))


def _speed(pusher: Track, time: Array, tips: dict[float, Array], begin: float, end: float) -> Array:
    """Mean speed (m/s) of the tip between two spans after times (n,), within its stream."""
    start, until = (np.clip(time + span, pusher.time[0], pusher.time[-1]) for span in (begin, end))
    distance = np.hypot(*(tips[end] - tips[begin])[:, :2].T)
    return np.asarray(distance / np.maximum(until - start, SHORTEST_SPAN))


def _repositioned(slider: Track, pusher: Track, first: int, last: int) -> BoolArray:
    """Whether the slider was placed elsewhere before each sample: by a jump, or in a dropout farther than the tip."""
    values, time = slider.values[max(first - 1, 0) : last], slider.time[max(first - 1, 0) : last]
    moved = np.hypot(*np.diff(values[:, :2], axis=0).T)
    driven = np.hypot(*np.diff(pusher.at(time)[:, :2], axis=0).T)
    in_dropout = (np.diff(time) > slider.longest_gap) & (moved > JUMP_DISTANCE + driven)
    repositioned = slider.is_jump(values[:-1], values[1:], np.diff(time)) | in_dropout
    return np.asarray(repositioned if first else np.append(False, repositioned))
