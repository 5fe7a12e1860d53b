"""What geometry and motion say at every slider sample: how near the pusher is, whether it moves, what is missing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import to_body
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.track import Track
from push_predictor.types import Array, BoolArray

MOTION_HALF_SPAN = 0.05  # s on either side of a sample over which the pusher's speed is judged
FORWARD_SPAN = 0.03  # s after a sample in which the pusher must move already
LOOKAHEAD = MOTION_HALF_SPAN  # s that the streams must have passed a sample before it is judged
JUMP = 0.005  # m between two samples, beside JUMP_SPEED: a reset of the slider, not a push
JUMP_SPEED = 1.5  # m/s
TURN = 0.1  # rad between two samples, beside TURN_SPEED
TURN_SPEED = 8.0  # rad/s


@dataclass(frozen=True)
class Judged:
    """One slider sample. stamp ns, time s, gap m between pusher and outline, height m of the tip above the slider.

    force: (fx, fy) N as the sensor says, None where unknown. speed: the pusher's, m/s, the smaller of around and after
    the sample. blind: a stream is silent here; broken: one was silent since the sample before; jumped: the slider was
    put elsewhere since the sample before.
    """

    stamp: int
    time: float
    gap: float
    height: float
    force: Array | None
    speed: float
    blind: bool
    broken: bool
    jumped: bool


def judge(rig: Rig, slider: Track, pusher: Track, wrench: Track | None, first: int, last: int) -> Iterator[Judged]:
    """Judge slider samples first to last - 1 (indices into the track)."""
    time, stamp = slider.time[first:last], slider.stamp[first:last]
    pose, tip = slider.values[first:last], pusher.at(time)
    touch = rig.outline.project(to_body(tip[:, :2], pose[:, [0, 1, 3]]))
    before = slider.time[max(first - 1, 0) : last - 1] if first else np.append(time[0], time[:-1])
    broken, blind = _silences([t for t in (slider, pusher, wrench) if t is not None], before, time)
    forces = _forces(wrench, time)
    speed = np.minimum(
        _speed(pusher, time - MOTION_HALF_SPAN, time + MOTION_HALF_SPAN), _speed(pusher, time, time + FORWARD_SPAN)
    )
    jumped = _jumps(slider, first, last)
    for k in range(len(time)):
        force = None if np.isnan(forces[k, 0]) else forces[k]
        gap, height = float(touch.distance[k]) - rig.pusher_radius, float(tip[k, 2] - pose[k, 2])
        yield Judged(
            int(stamp[k]),
            float(time[k]),
            gap,
            height,
            force,
            float(speed[k]),
            bool(blind[k]),
            bool(broken[k]),
            bool(jumped[k]),
        )


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
    return way / np.maximum(end - start, 1e-3)


def _jumps(slider: Track, first: int, last: int) -> BoolArray:
    values, time = slider.values[max(first - 1, 0) : last], slider.time[max(first - 1, 0) : last]
    step, lapse = np.abs(np.diff(values, axis=0)), np.diff(time)
    moved = np.hypot(step[:, 0], step[:, 1]) > JUMP + JUMP_SPEED * lapse
    jumped = moved | (step[:, 3] > TURN + TURN_SPEED * lapse)
    return jumped if first else np.append(False, jumped)
