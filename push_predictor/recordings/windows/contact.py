"""What geometry and motion say at every slider sample: how near the pusher is, whether it moves, what is missing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import to_body
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.track import JUMP, Track
from push_predictor.types import Array, BoolArray

REACH = 0.1  # s that the streams must have passed a sample before it is judged
NEAR = 0.05  # s around a sample over which motion and gap are judged
FORWARD_SPAN = 0.03  # s after a sample in which the pusher must move already
FIT_SPAN = 0.020  # s of a window that give its velocity and angle (contract, section 2)
NEAR_SHARE, REACH_SHARE = 0.8, 0.5  # of the speed until NEAR, and from FIT_SPAN to REACH: slower is setting off
SHORTEST_SPAN = 1e-3  # s; below it a difference says nothing about a speed


@dataclass(frozen=True)
class ContactSample:
    """One slider sample. stamp ns, time s, gap m between pusher and outline, height m of the tip above the slider.

    closing: how fast the gap shrinks after the sample, m/s. force: (fx, fy) N as the sensor says, None where unknown.
    speed: the pusher's, m/s, the smaller of around and after the sample; underway: it is not just setting off.
    blind: a stream is silent here; broken: one was silent since the sample before; jumped: the slider was put elsewhere
    since the sample before.
    """

    stamp: int
    time: float
    gap: float
    height: float
    closing: float
    force: Array | None
    speed: float
    underway: bool
    blind: bool
    broken: bool
    jumped: bool


def judge(
    rig: Rig, slider: Track, pusher: Track, wrench: Track | None, first: int, last: int
) -> Iterator[ContactSample]:
    """Judge slider samples first to last - 1 (indices into the track)."""
    time, stamp = slider.time[first:last], slider.stamp[first:last]
    height = pusher.at(time)[:, 2] - slider.values[first:last, 2]
    before = slider.time[max(first - 1, 0) : last - 1] if first else np.append(time[0], time[:-1])
    broken, blind = _silences([t for t in (slider, pusher, wrench) if t is not None], before, time)
    gap, closing = _gaps(rig, slider, pusher, first, last)
    around, after = _speed(pusher, time - NEAR, time + NEAR), _speed(pusher, time, time + FORWARD_SPAN)
    underway = _underway(pusher, time)
    speed, forces, jumped = np.minimum(around, after), _forces(wrench, time), _jumps(slider, pusher, first, last)
    for k in range(len(time)):
        yield ContactSample(
            stamp=int(stamp[k]),
            time=float(time[k]),
            gap=float(gap[k]),
            height=float(height[k]),
            closing=float(closing[k]),
            force=None if np.isnan(forces[k, 0]) else forces[k],
            speed=float(speed[k]),
            underway=bool(underway[k]),
            blind=bool(blind[k]),
            broken=bool(broken[k]),
            jumped=bool(jumped[k]),
        )


def _underway(pusher: Track, time: Array) -> BoolArray:
    """Whether the tip does not just set off at times (n,); a stream too slow to tell is taken at its word."""
    if 3.0 * pusher.period > FIT_SPAN:
        return np.ones(len(time), dtype=np.bool_)
    first = _speed(pusher, time, time + FIT_SPAN)
    near, later = _speed(pusher, time, time + NEAR), _speed(pusher, time + FIT_SPAN, time + REACH)
    return np.asarray((first >= NEAR_SHARE * near) & (first >= REACH_SHARE * later))


def _gaps(rig: Rig, slider: Track, pusher: Track, first: int, last: int) -> tuple[Array, Array]:
    """Gap (n,) m at the samples, and how fast it shrinks (n,) m/s in the NEAR after each."""
    ahead = int(np.searchsorted(slider.time, slider.time[last - 1] + NEAR, side="right"))
    time, pose = slider.time[first:ahead], slider.values[first:ahead][:, [0, 1, 3]]
    gap = rig.outline.project(to_body(pusher.at(time)[:, :2], pose)).distance - rig.pusher_radius
    # The last sample within reach, not a value in between: what comes after it may not have arrived yet.
    later = np.searchsorted(time, time + NEAR, side="right") - 1
    closing = (gap - gap[later]) / np.maximum(time[later] - time, SHORTEST_SPAN)
    return gap[: last - first], closing[: last - first]


def _silences(tracks: list[Track], before: Array, time: Array) -> tuple[BoolArray, BoolArray]:
    broken, blind = np.zeros(len(time), dtype=np.bool_), np.zeros(len(time), dtype=np.bool_)
    for track in tracks:
        overlap, beyond = track.silent_in(before, time)
        broken, blind = broken | overlap, blind | beyond
    return broken, blind


def _forces(wrench: Track | None, time: Array) -> Array:
    if wrench is None:
        return np.full((len(time), 2), np.nan)
    return wrench.at(time)


def _speed(pusher: Track, start: Array, end: Array) -> Array:
    """Mean speed (m/s) of the tip between two times each, as far as its stream reaches."""
    start, end = np.maximum(start, pusher.time[0]), np.minimum(end, pusher.time[-1])
    way = np.linalg.norm(pusher.at(end)[:, :2] - pusher.at(start)[:, :2], axis=1)
    return np.asarray(way / np.maximum(end - start, SHORTEST_SPAN))


def _jumps(slider: Track, pusher: Track, first: int, last: int) -> BoolArray:
    """Whether the slider was put elsewhere before each sample: at once, or unseen, farther than the tip can push it."""
    values, time = slider.values[max(first - 1, 0) : last], slider.time[max(first - 1, 0) : last]
    way = np.hypot(*np.diff(values[:, :2], axis=0).T)
    driven = np.hypot(*np.diff(pusher.at(time)[:, :2], axis=0).T)
    unseen = (np.diff(time) > slider.longest_gap) & (way > JUMP + driven)
    jumped = slider.torn(values[:-1], values[1:], np.diff(time)) | unseen
    return np.asarray(jumped if first else np.append(False, jumped))
