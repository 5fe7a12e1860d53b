# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The lag of the slider's stamps against the tip's, of each push by itself.

In a push the tip is at the outline. Where the clocks are apart it is there at another time: of the lags tried, the one
that brings the tip nearest to the outline while the slider moves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from push_predictor.geometry.frames import to_body
from push_predictor.recordings.checks.motion import SPANS, in_time, moving_slider, noise_of, values_at
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.types import Array, BoolArray, IntArray

ComplexArray: TypeAlias = NDArray[np.complex128]
LONGEST = 1.0  # s: lags that are tried around 0, and around a longer lag at which the motions are alike
FARTHEST = 120.0  # s: of these longer lags
GRID = 0.05  # s: of the velocities that are compared for them
BLOCK, TOUCHING = 20, 0.2  # pushes of one longer lag; share of them at the outline up to which one is sought
COARSE, FINE = 0.025, 0.0025  # s between them: first all, then around the best
SAMPLES = 6  # of each push
MOST_PUSHES = 160  # evenly drawn
NOISE = 2.0  # standard deviations of a position
SHORTEST = 0.15  # s that a slider moves in a push
LEAST_STEP = 0.0005  # m in GRID: smaller ones are hidden in noise
LARGEST_GAP = 0.005  # m: a larger one counts as this much
TOUCH = 0.001  # m, in the mean and beyond the tracker's noise: the tip was at the outline


@dataclass(frozen=True, eq=False)
class PushLags:
    """The pushes (n,) in which a lag brings the tip to the outline.

    time (n,): s from the slider's first stamp; lag (n,): s, positive where the slider's stamps are late. share: of the
    motions of the slider that these are.
    """

    time: Array
    lag: Array
    share: float


def push_lags(recording: Recording, rig: Rig) -> PushLags | None:
    """The lags of the slider's stamps by push, None if it does not move."""
    slider, pusher = recording.slider, recording.pusher
    if min(len(slider), len(pusher)) < SAMPLES:
        return None
    origin = int(slider.stamp[0])
    time, pose = in_time(slider.stamp, origin, slider.x, slider.y, np.unwrap(slider.heading))
    tip_time, tip = in_time(pusher.stamp, origin, pusher.x, pusher.y)
    rows = _rows(time, moving_slider(time, pose, rig))
    if not len(rows):
        return None
    at = time[rows]
    noise = NOISE * float(np.max(noise_of(pose[:, :2])))

    def cost(lag: Array, pushes: IntArray) -> Array:
        """Mean distances (n,) m of the tip from the outline in pushes (n,), at their lags (n,)."""
        when = (at[pushes] - lag[:, None]).ravel()
        gap = rig.outline.project(to_body(values_at(when, tip_time, tip), pose[rows[pushes].ravel()])).distance
        gap = np.minimum(np.abs(gap - rig.pusher_radius), LARGEST_GAP)
        return np.asarray(gap.reshape(-1, SAMPLES).mean(axis=1))

    def best(around: Array, pushes: IntArray) -> tuple[Array, BoolArray]:
        """The lags (n,) of the smallest distance near given ones, and whether the tip was at the outline then."""
        for step, reach in ((COARSE, LONGEST), (FINE, COARSE)):
            tried = around + np.arange(-reach, reach + 0.5 * step, step)[:, None]
            costs = np.array([cost(lag, pushes) for lag in tried])
            around = tried[np.argmin(costs, axis=0), np.arange(len(pushes))]
        return around, costs.min(axis=0) < TOUCH + noise

    lag, touched = best(np.zeros(len(at)), np.arange(len(at)))
    for pushes in np.array_split(np.arange(len(at)), max(1, len(at) // BLOCK)):
        if np.mean(touched[pushes]) < TOUCHING:
            span = (float(at[pushes[0], 0]), float(at[pushes[-1], -1]))
            longer = _like_lag(time, pose[:, :2], tip_time, tip, span)
            lag[pushes], touched[pushes] = best(np.full(len(pushes), longer), pushes)
    return PushLags(at.mean(axis=1)[touched], lag[touched], float(np.mean(touched)))


def _like_lag(time: Array, place: Array, tip_time: Array, tip: Array, span: tuple[float, float]) -> float:
    """The lag (s) at which the slider moves most like the tip within a span (s), wherever their frames are."""
    grid = np.arange(min(time[0], tip_time[0]), max(time[-1], tip_time[-1]) + 2.0 * FARTHEST, GRID)
    within = (grid > span[0]) & (grid < span[1])
    slider, pusher = (_direction(values_at(grid, *each)) for each in ((time, place), (tip_time, tip)))
    alike = np.abs(np.fft.ifft(np.conj(np.fft.fft(np.where(within, slider, 0.0))) * np.fft.fft(pusher)))
    shift = np.fft.fftfreq(len(grid), 1.0 / len(grid)) * GRID
    return -float(shift[np.argmax(np.where(np.abs(shift) < FARTHEST, alike, 0.0))])


def _direction(place: Array) -> ComplexArray:
    """Directions (n,) in which places (n, 2) change, as complex numbers of at most length 1; 0 at rest."""
    step = np.gradient(place[:, 0] + 1j * place[:, 1])
    return np.asarray(step / (np.abs(step) + LEAST_STEP))


def _rows(time: Array, moving: BoolArray) -> IntArray:
    """Indices (pushes, SAMPLES) of samples in the middle of each motion."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], moving.astype(np.int8), [0]])))
    spans = edges.reshape(-1, 2) - [0, 1]
    spans = spans[time[spans[:, 1]] - time[spans[:, 0]] > SHORTEST + 2.0 * SPANS[0]]
    if not len(spans):
        return np.empty((0, SAMPLES), dtype=np.int64)
    spans = spans[np.unique(np.linspace(0, len(spans) - 1, MOST_PUSHES).astype(np.int64))]
    begin, end = time[spans[:, 0]] + SPANS[0], time[spans[:, 1]] - SPANS[0]
    return np.asarray(np.searchsorted(time, np.linspace(begin, end, SAMPLES, axis=1)))
