# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Repetitions of a push on the rig simulator, and distances of a predicted distribution from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from push_predictor.geometry.frames import to_body, to_world
from push_predictor.simulation.batches import run_pushes
from push_predictor.simulation.pushes import PushPlan
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array

BRAKING = 0.004  # m of a push's travel that no pose is taken from
DRAWS = 1000  # of the bootstrap over the repeats


@dataclass(frozen=True, eq=False)
class Repeats:
    """n repetitions of one push: poses (k, n, 3) at times (k,) s after the first contact, in the body frame then."""

    time: Array
    poses: Array


def repeats(contact: float, angle: float, speed: float, times: Array, count: int, seed: int) -> Repeats:
    """Simulate repetitions; table and slider are those of bags/square_abs_*, all else is drawn for each repetition."""
    travel = speed * float(max(times)) + BRAKING
    plan = PushPlan(*(np.full(count, value) for value in (contact, angle, speed, travel)))
    poses = []
    for batch in run_pushes(SimulationSpec("rect1", "abs", plan, seed=seed)):
        motion = batch.motion
        touching = np.hypot(motion.wrench[..., 0], motion.wrench[..., 1]) > 0.0
        for row, first in enumerate(np.argmax(touching, axis=1)):
            begin, time = motion.slider[row, first], motion.time[row, first] + times
            at = np.column_stack([np.interp(time, motion.time[row], column) for column in motion.slider[row].T])
            poses.append(np.column_stack([to_body(at[:, :2], begin), at[:, 2] - begin[2]]))
    return Repeats(times, np.stack(poses, axis=1))


def in_turn(pushes: Sequence[Array]) -> Array:
    """Poses (n, 3) after successive pushes, each (n, 3) relative to the slider at its start.

    Repetitions of different pushes are independent, so any combination of them is a repetition of the sequence.
    """
    at = np.zeros_like(pushes[0])
    for moved in pushes:
        at = np.column_stack([to_world(moved[:, :2], at), at[:, 2] + moved[:, 2]])
    return at


class EnergyDistance:
    """2 E|X - Y| - E|X - X'| - E|Y - Y'| of poses, m: x, y as they are, heading times `arm` (m); 0 for equal laws.

    Unbiased: no draw is compared with itself (Szekely and Rizzo 2013). samples (p, 3) of the model, truth (n, 3).
    """

    def __init__(self, samples: Array, truth: Array, arm: float) -> None:
        x, y = (poses * [1.0, 1.0, arm] for poses in (samples, truth))
        self._within = cdist(x, x).sum() / (len(x) * (len(x) - 1))
        self._across, self._of_truth = cdist(y, x).mean(axis=1), cdist(y, y)

    def value(self, weight: Array | None = None) -> float:
        """The distance; weight (n,): how often a bootstrap drew each pose of the truth."""
        w = np.ones(len(self._across)) if weight is None else weight
        of_truth = w @ self._of_truth @ w / (w.sum() ** 2 - w @ w)
        return float(2.0 * w @ self._across / w.sum() - self._within - of_truth)


def weights_of(count: int, seed: int = 0) -> Array:
    """How often each of `count` repeats comes in DRAWS bootstrap samples, (DRAWS, count)."""
    rng = np.random.default_rng(seed)
    return rng.multinomial(count, np.full(count, 1.0 / count), DRAWS).astype(np.float64)


def covered(samples: Array, truth: Array) -> Array:
    """Which poses (n, 3) lie in the ellipsoid about the samples' mean that holds 95 % of the samples: (n,)."""
    mean, inverse = samples.mean(axis=0), np.linalg.inv(np.cov(samples.T))
    far, from_there = (np.einsum("ni,ij,nj->n", x - mean, inverse, x - mean) for x in (samples, truth))
    return np.asarray(from_there <= np.quantile(far, 0.95))
