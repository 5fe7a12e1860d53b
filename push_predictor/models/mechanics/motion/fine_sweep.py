# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The sweep for small tolerances: steps of fourth order, each compared with two of half its length.

An embedded method estimates the error from the stages of one step, and may miss a kink of the rate between them: where
slip begins or ends, at a corner, where contact is lost. Half steps do not.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from push_predictor.models.mechanics.motion.sweep import LONGEST_STEP, TOUCHING, RateOf, size_of
from push_predictor.types import Array, IntArray

OF_TRAVEL_FINELY = 0.01  # of the accuracy: the error of a step that is allowed for the whole travel

Rates: TypeAlias = tuple[Array, Array, Array]  # see RateOf


def swept_finely(rate_of: RateOf, travel: Array, length: Array, accuracy: float) -> Array:
    """See sweep.swept: poses (n, 3)."""
    pose, done, longest = np.zeros((len(travel), 3)), np.zeros(len(travel)), np.minimum(travel, LONGEST_STEP)
    rows = np.flatnonzero(travel > 0.0)
    while rows.size:
        before, at = pose[rows], done[rows]
        first = rate_of(rows, before, at)
        step = np.minimum(longest[rows], travel[rows] - at)
        step = np.where((first[1] >= TOUCHING) & (first[2] > 0.0), np.minimum(step, first[1]), step)
        half = at + 0.5 * step
        coarse, middle = _both(rate_of, rows, before, at, step, first)
        fine = _advance(rate_of, rows, middle, half, 0.5 * step, rate_of(rows, middle, half))
        allowed = accuracy * (size_of(fine - before, length[rows]) + OF_TRAVEL_FINELY * travel[rows])
        agree = size_of(fine - coarse, length[rows]) <= allowed
        pose[rows] = np.where(agree[:, None], fine, before)
        done[rows] = np.where(agree, at + step, at)
        longest[rows] = np.where(agree, np.minimum(2.0 * step, LONGEST_STEP), 0.5 * step)
        rows = rows[travel[rows] - done[rows] > 1e-12 * travel[rows]]
    return pose


def _both(rate_of: RateOf, rows: IntArray, pose: Array, done: Array, step: Array, first: Rates) -> tuple[Array, Array]:
    """Poses (k, 3) after the step and after half of it, computed as one set of pushes."""
    rate, gap, nearing = (np.concatenate([part, part]) for part in first)
    pose, done, steps = np.concatenate([pose, pose]), np.concatenate([done, done]), np.concatenate([step, 0.5 * step])
    after = _advance(rate_of, np.concatenate([rows, rows]), pose, done, steps, (rate, gap, nearing))
    return after[: len(step)], after[len(step) :]


def _advance(rate_of: RateOf, rows: IntArray, pose: Array, done: Array, step: Array, first: Rates) -> Array:
    """Poses (k, 3) after one step (k,) m of the classical Runge-Kutta method; first: the rates where it begins."""
    h, half = step[:, None], done + 0.5 * step
    k2, *_ = rate_of(rows, pose + 0.5 * h * first[0], half)
    k3, *_ = rate_of(rows, pose + 0.5 * h * k2, half)
    k4, *_ = rate_of(rows, pose + h * k3, done + step)
    motion = h / 6.0 * (first[0] + 2.0 * k2 + 2.0 * k3 + k4)
    return pose + np.where((first[1] < TOUCHING)[:, None], motion, 0.0)
