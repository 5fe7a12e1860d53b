# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Samples of the slider's pose along sequences of pushes: which touch an obstacle or fall, which reach a target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, to_world
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.types import Array, BoolArray, IntArray

FRACTIONS = (0.25, 0.5, 0.75, 1.0)  # of a push, at which the slider is checked
STRAIGHT = 1e-9  # rad; below it a push counts as straight


@dataclass(frozen=True, eq=False)
class Beliefs:
    """The slider's pose after n sequences of k pushes.

    rows (n, k): of the repertoire. mean (n, 3): pose without noise. samples (n, p, 3); safe (n, p): neither touched nor
    fallen so far. survival (n,): probability that the slider was safe in all pushes before the last observation.
    """

    rows: IntArray
    mean: Array
    samples: Array
    safe: BoolArray
    survival: Array

    def __len__(self) -> int:
        return len(self.mean)

    @property
    def risk(self) -> Array:
        """Probability (n,) that the slider has touched or fallen."""
        return np.asarray(1.0 - self.survival * self.safe.mean(axis=1))

    def take(self, which: IntArray | BoolArray) -> Beliefs:
        """The given sequences (indices or mask)."""
        return Beliefs(*(values[which] for values in vars(self).values()))

    def observed(self) -> Beliefs:
        """The same with every slider seen at its pose without noise."""
        samples = np.broadcast_to(self.mean[:, None], self.samples.shape)
        return Beliefs(self.rows, self.mean, samples, np.ones_like(self.safe), 1.0 - self.risk)

    def pushed(self, rows: IntArray, mean: Array, outcomes: Array, scene: Scene, margin: float) -> Beliefs:
        """The beliefs after one more push each: rows (n,), mean (n, 3) and samples (n, p, 3) of its displacement."""
        fractions = np.array(FRACTIONS)[:, None, None]
        path = after_displacement(self.samples, partial_displacement(outcomes, fractions))
        safe = self.safe & scene.safe(path, margin).all(axis=0)
        return Beliefs(
            np.column_stack([self.rows, rows]), after_displacement(self.mean, mean), path[-1], safe, self.survival
        )


def certain(slider: Array, draws: int) -> Beliefs:
    """One slider at a known pose (3,), before any push."""
    samples = np.broadcast_to(slider, (1, draws, 3))
    nothing = np.empty((1, 0), dtype=np.int64)
    return Beliefs(nothing, slider[None], samples, np.ones((1, draws), dtype=np.bool_), np.ones(1))


def after_displacement(poses: Array, moved: Array) -> Array:
    """Poses (..., 3) after displacements moved (..., 3) in their body frames; the shapes broadcast."""
    return np.concatenate([to_world(moved[..., :2], poses), poses[..., 2:] + moved[..., 2:]], axis=-1)


def partial_displacement(moved: Array, fraction: Array) -> Array:
    """Displacements (..., 3) after a fraction (...) of a motion with constant twist to displacements moved (..., 3)."""
    turn = moved[..., 2]
    half = np.where(np.abs(turn) < STRAIGHT, STRAIGHT, 0.5 * turn)
    chord = np.sin(fraction * half) / np.sin(half)
    shift = chord[..., None] * rotate(np.broadcast_to(moved[..., :2], (*chord.shape, 2)), -(1.0 - fraction) * half)
    return np.concatenate([shift, (fraction * turn)[..., None]], axis=-1)
