# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What trackers, drivers and recorders do to a stream of poses, done to a sound one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.geometry.frames import wrap_angle
from push_predictor.recordings.streams import PoseStream, joined, taken
from push_predictor.types import Array, IntArray

MS = 1_000_000


def held(stream: PoseStream, rate: float) -> PoseStream:
    """Poses of a slower source (Hz), republished with the stamps of the stream."""
    time = 1e-9 * (stream.stamp - stream.stamp[0])
    ticks = np.arange(0.0, time[-1], 1.0 / rate)
    tick = np.clip(np.searchsorted(ticks, time, side="right") - 1, 0, len(ticks) - 1)
    source = np.clip(np.searchsorted(time, ticks, side="right") - 1, 0, len(time) - 1)[tick]
    return replace(taken(stream, source), stamp=stream.stamp)


def lost(stream: PoseStream, begins: IntArray, samples: int) -> PoseStream:
    """The pose before each of some indices, repeated for so many samples."""
    source = np.arange(len(stream))
    for begin in begins.tolist():
        source[begin : begin + samples] = begin - 1
    return replace(taken(stream, source), stamp=stream.stamp)


def rounded(stream: PoseStream, step: float, turn: float) -> PoseStream:
    """Positions in steps (m), headings in turns (rad)."""
    x, y, z = (np.round(of / step) * step for of in (stream.x, stream.y, stream.z))
    return replace(stream, x=x, y=y, z=z, heading=np.round(stream.heading / turn) * turn)


def flipped(stream: PoseStream, begins: IntArray, samples: int, turn: float) -> PoseStream:
    """Headings turned (rad) for so many samples from each of some indices on."""
    heading = stream.heading.copy()
    for begin in begins.tolist():
        heading[begin : begin + samples] += turn
    return replace(stream, heading=wrap_angle(heading))


def at_rate(stream: PoseStream, rate: float) -> PoseStream:
    """The stream at another rate (Hz)."""
    stamp = np.arange(stream.stamp[0], stream.stamp[-1], round(1e9 / rate))

    def at(values: Array) -> Array:
        return np.interp(stamp - stream.stamp[0], stream.stamp - stream.stamp[0], values)

    x, y, z, heading = (at(of) for of in (stream.x, stream.y, stream.z, np.unwrap(stream.heading)))
    return PoseStream(stamp, x, y, z, heading)


def in_bursts(stamp: IntArray, seed: int = 0) -> IntArray:
    """Stamps of receipt: most about 1 ms late, but every sixth time three or four samples arrive together."""
    rng = np.random.default_rng(seed)
    found = stamp + MS * rng.exponential(1.0, len(stamp))
    k = 0
    while k < len(stamp):
        count = int(rng.integers(3, 5)) if rng.random() < 0.16 else 1
        if count > 1:
            end = min(k + count, len(stamp))
            found[k:end] = stamp[end - 1] + MS * (rng.uniform(0.0, 4.0) + np.arange(end - k) * rng.uniform(0.1, 0.8))
        k += count
    return np.maximum.accumulate(found).astype(np.int64) + np.arange(len(stamp))


def with_another(stream: PoseStream, stamp: IntArray, first: bool = False) -> PoseStream:
    """The stream with poses of another body, at rest elsewhere; first: before those of the same stamp."""
    count = len(stamp)
    other = PoseStream(stamp, np.full(count, 0.3), np.full(count, 0.2), np.zeros(count), np.zeros(count))
    both = joined([other, stream] if first else [stream, other])
    return taken(both, np.argsort(both.stamp, kind="stable"))
