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

"""Motion of sliders while a disc sweeps along straight lines: any rate, integrated over the travel.

The motion depends on the path, not on the speed: the travel of the pusher (m) takes the place of time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from push_predictor.types import Array, IntArray

LONGEST_STEP = 0.004  # m: about the radius of a pusher, so that no corner is stepped over
OF_TRAVEL = 0.1  # of the accuracy: the error of a step that is allowed for the whole travel
FINE = 1e-4  # accuracy up to which fine_sweep is used
TOUCHING = 2e-5  # m: a wider gap at the start of a step is no contact
SHORTEST_STEP = 30.0  # accuracies of the longest: a jump of the rate is crossed in steps of this length

# From the rows (k,), their poses (k, 3) and the travel done (k,) m to the change of the pose (k, 3) per metre, the gap
# between disc and slider (k,) m, and whether the disc comes closer (k,).
Rates: TypeAlias = tuple[Array, Array, Array]
RateOf: TypeAlias = Callable[[IntArray, Array, Array], Rates]


def swept(rate_of: RateOf, travel: Array, length: Array, accuracy: float) -> Array:
    """Pose (n, 3: x, y in m, heading in rad) of the body after travel (n,) m, from the pose (0, 0, 0).

    length (n,) m: of the arc that a turn counts as. accuracy: of a displacement, relative. Bogacki and Shampine's
    method of third order, with steps chosen by its error of second order. Where the disc does not touch, the slider
    rests until it does.
    """
    shortest = SHORTEST_STEP * accuracy * LONGEST_STEP
    pose, done, step = np.zeros((len(travel), 3)), np.zeros(len(travel)), np.minimum(travel, LONGEST_STEP)
    rows = np.flatnonzero(travel > 0.0)
    first, gap, nearing = rate_of(rows, pose[rows], done[rows]) if rows.size else (pose, done, done)
    while rows.size:
        h, before, at = np.minimum(step[rows], travel[rows] - done[rows]), pose[rows], done[rows]
        apart = gap >= TOUCHING
        h = np.where(apart & (nearing > 0.0), np.minimum(h, gap), h)
        wide = np.where(apart, 0.0, h)[:, None]
        k2, *_ = rate_of(rows, before + 0.5 * wide * first, at + 0.5 * h)
        k3, *_ = rate_of(rows, before + 0.75 * wide * k2, at + 0.75 * h)
        motion = wide * (2.0 * first + 3.0 * k2 + 4.0 * k3) / 9.0
        last, gap_after, nearing_after = rate_of(rows, before + motion, at + h)
        error = wide * (-5.0 * first + 6.0 * k2 + 8.0 * k3 - 9.0 * last) / 72.0
        allowed = accuracy * (size_of(motion, length[rows]) + OF_TRAVEL * travel[rows])
        ratio = size_of(error, length[rows]) / allowed
        agree = ~(ratio > 1.0) | (h <= shortest)  # what is not a number ends, too
        pose[rows] = np.where(agree[:, None], before + motion, before)
        done[rows] = np.where(agree, at + h, at)
        factor = np.clip(0.9 * np.maximum(ratio, 1e-3) ** (-1.0 / 3.0), 0.2, 4.0)
        step[rows] = np.clip(h * factor, shortest, LONGEST_STEP)
        first, gap = np.where(agree[:, None], last, first), np.where(agree, gap_after, gap)
        nearing = np.where(agree, nearing_after, nearing)
        on = travel[rows] - done[rows] > 1e-12 * travel[rows]
        rows, first, gap, nearing = rows[on], first[on], gap[on], nearing[on]
    return pose


def size_of(motion: Array, length: Array) -> Array:
    """Sizes (n,) of motions (n, 3) in m: a turn counts as its arc at the length (n,)."""
    return np.asarray(np.sqrt(motion[:, 0] ** 2 + motion[:, 1] ** 2 + (length * motion[:, 2]) ** 2))
