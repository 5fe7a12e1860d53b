# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Push tables from the true motion, without sensors, for grids that are too large to record."""

from __future__ import annotations

import numpy as np

from push_predictor.geometry.frames import rotate, to_body
from push_predictor.geometry.outline import Outline
from push_predictor.recordings.table import PushTable, concatenate
from push_predictor.simulation.batches import Batch, run_pushes
from push_predictor.simulation.dynamics import Motion
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array, BoolArray, IntArray

LEAST_CONTACT = 0.9  # share of a window with contact


def push_outcomes(spec: SimulationSpec, duration: float = 0.2) -> PushTable:
    """The windows of a spec's pushes, end to end from the first touch, at constant speed and in contact.

    push_id is the row of the plan. Raises RigError for an unknown shape or surface.
    """
    return concatenate([_windows(batch, spec.slider.outline, duration) for batch in run_pushes(spec)])


def _windows(batch: Batch, outline: Outline, duration: float) -> PushTable:
    motion = batch.motion
    touching = np.hypot(motion.wrench[..., 0], motion.wrench[..., 1]) > 0.0
    push, begin = _tiles(batch, touching, duration)
    end = begin + duration
    kept = _contact_share(touching, motion, push, begin, end) >= LEAST_CONTACT
    return _table(batch, outline, push[kept], begin[kept], duration)


def _tiles(batch: Batch, touching: BoolArray, duration: float) -> tuple[IntArray, Array]:
    """Push (w,) and start time (w,) of the windows from first touch until the tip decelerates."""
    path = batch.path
    first = batch.motion.time[np.arange(len(touching)), np.argmax(touching, axis=1)]
    cruise_end = path.push_time - path.speed / path.acceleration
    counts = np.where(touching.any(axis=1), np.maximum((cruise_end - first) // duration, 0), 0).astype(np.int64)
    push = np.repeat(np.arange(len(counts)), counts)
    order = np.arange(len(push)) - np.repeat(np.cumsum(counts) - counts, counts)
    return push, first[push] + order * duration


def _contact_share(touching: BoolArray, motion: Motion, push: IntArray, begin: Array, end: Array) -> Array:
    """Share (w,) of each window during which the tip touches the slider."""
    step = motion.time[push, 1]
    since = np.cumsum(touching, axis=1)
    low, high = (np.round(time / step).astype(np.int64) for time in (begin, end))
    return np.asarray((since[push, high] - since[push, low]) / np.maximum(high - low, 1))


def _table(batch: Batch, outline: Outline, push: IntArray, begin: Array, duration: float) -> PushTable:
    motion, path = batch.motion, batch.path
    before, after = (_at(motion.slider, motion, push, time) for time in (begin, begin + duration))
    ahead = path.direction[push]
    nearest = outline.project(to_body(_at(motion.pusher, motion, push, begin), before))
    inward = -rotate(nearest.normal, before[:, 2])
    across = inward[:, 0] * ahead[:, 1] - inward[:, 1] * ahead[:, 0]
    angle = np.arctan2(across, np.sum(inward * ahead, axis=1))
    moved = rotate(after[:, :2] - before[:, :2], -np.arctan2(ahead[:, 1], ahead[:, 0]))
    return PushTable(
        np.stack([path.speed[push], nearest.contact, angle], axis=1),
        np.full(len(push), duration),
        np.column_stack([moved, after[:, 2] - before[:, 2]]),
        batch.rows[push].astype(np.str_),
    )


def _at(values: Array, motion: Motion, push: IntArray, time: Array) -> Array:
    """Rows (w, k) of values (n, t, k) at times (w,) of pushes (w,), linear between steps."""
    place = time / motion.time[push, 1]
    index = np.minimum(place.astype(np.int64), values.shape[1] - 2)
    share = (place - index)[:, None]
    return np.asarray((1.0 - share) * values[push, index] + share * values[push, index + 1])
