# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a stream of poses is by itself: rate, resolution, noise, and what was repaired in it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.recordings.checks.motion import noise_of
from push_predictor.recordings.dropouts import NANOSECOND
from push_predictor.recordings.streams import PoseStream
from push_predictor.recordings.windows.repairs.held import HeldPoses
from push_predictor.recordings.windows.repairs.resolution import LEVER, Resolution, changes, lengths
from push_predictor.recordings.windows.repairs.smoothing import SHORTEST, SmoothedPoses, fit_span
from push_predictor.recordings.windows.stamp_order import OrderedSamples
from push_predictor.types import Array

LEAST_SHARE = 1.0 / 6.0  # of the poses in motion are repeats: the source is slower than its messages
MOST_HOLDS = 0.2  # of the runs of repeats are longer than usual
FEWEST_MOVING = 100  # samples in motion, from which the rate of the source is estimated
AROUND = 25  # samples on either side that show whether a body moves: more than a slow source repeats a pose
STEPS, LEAST_WAY = 3.0, 5e-5  # steps of the resolution, m: a body moves by more in one interval
ROUNDED = np.sqrt(12.0)  # standard deviations of a rounding error in one step


@dataclass(frozen=True)
class StreamFacts:
    """A stream of poses in its own stamps.

    period: median interval of the stamps, s; source_period: of the poses behind them, the same unless the stream
    repeats them. quantum: resolution of the positions (m), heading_quantum (rad), 0 where it is unknown. fit_span: the
    span (s) that lines need for a speed in this resolution. noise (m), heading_noise (rad): standard deviations of a
    sample. held: number of stale poses; holds: how often, beyond the usual interval, they were held.
    """

    samples: int
    period: float
    source_period: float
    quantum: float
    heading_quantum: float
    fit_span: float
    noise: float
    heading_noise: float
    held: int
    holds: tuple[float, ...]

    @property
    def slower_source(self) -> bool:
        """Whether the poses come from a source that is slower than the messages."""
        return self.source_period > self.period

    @property
    def coarse(self) -> bool:
        """Whether the resolution is too coarse for the speed over the first 20 ms of a window."""
        return self.fit_span > SHORTEST


def pose_facts(stream: PoseStream, angle: bool) -> tuple[StreamFacts, PoseStream]:
    """The facts of a stream of at least two poses, and the stream as repaired; angle: whether headings count.

    The stamps must increase.
    """
    values = np.column_stack([stream.x, stream.y, stream.z, np.unwrap(stream.heading)])
    column = 3 if angle else None
    pose = lengths(values, column)
    quanta = Resolution(pose.shape[1]).take(pose)
    quantum = float(np.max(quanta[-1]))
    samples = OrderedSamples(
        stream.stamp, np.column_stack([values, np.max(quanta, axis=1)]), np.zeros(len(values), dtype=np.bool_), False
    )
    held = HeldPoses(column)
    kept = held.take(samples, final=True)
    smoothed = SmoothedPoses(column).take(kept, final=True)
    period = float(np.median(np.diff(stream.stamp))) * NANOSECOND
    source_period = _source_period(pose, quantum, period, len(held.dropouts))
    measured = values[changes(pose)] if source_period > period else values
    noise = noise_of(measured[:, [0, 1, 3]], order=3)  # of third differences: motion hardly changes them
    facts = StreamFacts(
        samples=len(stream),
        period=period,
        source_period=source_period,
        quantum=float(np.max(quanta[-1, :2])),
        heading_quantum=float(quanta[-1, 2] / LEVER) if angle else 0.0,
        fit_span=float(fit_span(quantum, period)),
        noise=float(max(*noise[:2], np.max(quanta[-1, :2]) / ROUNDED)),
        heading_noise=float(noise[2]) if angle else 0.0,
        held=held.stale,
        holds=tuple(held.dropouts),
    )
    return facts, _with(stream, smoothed) if held.stale or facts.coarse else stream


def _with(stream: PoseStream, samples: OrderedSamples) -> PoseStream:
    rows = np.searchsorted(stream.stamp, samples.stamp)
    x, y, z, heading = samples.values[:, :4].T
    tilt = None if stream.tilt is None else stream.tilt[rows]
    return replace(stream, stamp=samples.stamp, x=x, y=y, z=z, heading=heading, tilt=tilt)


def _source_period(pose: Array, quantum: float, period: float, holds: int) -> float:
    """The mean interval (s) of new poses in motion, where many of them are repeated; else the period."""
    if len(pose) <= 2 * AROUND:
        return period
    way = np.linalg.norm(pose[2 * AROUND :] - pose[: -2 * AROUND], axis=1) / (2 * AROUND)
    moving = way > np.maximum(STEPS * quantum, LEAST_WAY)
    again = np.all(pose[1:] == pose[:-1], axis=1)[AROUND - 1 : -AROUND]
    count = int(np.sum(moving))
    share = float(np.mean(again[moving])) if count else 0.0
    runs = int(np.sum(again[1:] & ~again[:-1] & moving[1:]))
    if holds > MOST_HOLDS * runs:  # single losses, not a slow source
        return period
    return period / (1.0 - share) if count >= FEWEST_MOVING and LEAST_SHARE < share < 1.0 else period
