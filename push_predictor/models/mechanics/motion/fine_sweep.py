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

"""The sweep for small tolerances, in steps of fourth order.

An embedded method estimates the error from the stages of one step, and may miss a kink of the rate between them: where
slip begins or ends, at a corner, where contact is lost. Where all stages have contacts of one kind, and the friction is
constant, there is none, and the estimate holds. Other steps are compared with two of half their length, and so are
those that follow, until one is smooth.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from push_predictor.models.mechanics.motion.sweep import LONGEST_STEP, TOUCHING, size_of
from push_predictor.types import Array, BoolArray, IntArray

OF_CORNER, SHORTEST_AT_CORNER = 0.25, 1e-4  # of the allowed error: how far the disc may enter; m: in longer steps
OF_TRAVEL_FINELY = 0.01  # of the accuracy: the error of a step that is allowed for the whole travel
# Kutta's 3/8 rule (1901) of fourth order has its stages at 0, 1/3, 2/3 and 1 of a step. With these weights they and the
# rate AFTER the step give the difference from a method of third order, also where rates depend on the travel alone.
DIFFERENCE, AFTER = (1.0 / 24.0, -1.0 / 8.0, 1.0 / 8.0, 1.0 / 8.0), -1.0 / 6.0


# As sweep.Rates, and the kind of contact (k,): a number that stays the same while the rate is smooth.
KindRates: TypeAlias = tuple[Array, Array, Array, Array]
KindRateOf: TypeAlias = Callable[[IntArray, Array, Array], KindRates]


def swept_finely(rate_of: KindRateOf, travel: Array, length: Array, accuracy: float) -> Array:
    """See sweep.swept: poses (n, 3)."""
    pose, done, longest = np.zeros((len(travel), 3)), np.zeros(len(travel)), np.minimum(travel, LONGEST_STEP)
    rows, rough = np.flatnonzero(travel > 0.0), np.zeros(len(travel), dtype=np.bool_)
    first = rate_of(rows, pose[rows], done[rows])
    while rows.size:
        before, at, in_halves = pose[rows], done[rows], np.flatnonzero(rough[rows])
        step = np.minimum(longest[rows], travel[rows] - at)
        apart = first[1] >= TOUCHING
        step = np.where(apart & (first[2] > 0.0), np.minimum(step, first[1]), step)
        # The first halves of rough steps are computed with the whole ones, as one set of pushes.
        begin = _Begin(rows, before, at, step, first)
        stepped, ended = _stepped(rate_of, _with_halves(begin, in_halves))
        coarse, last = stepped.pose[: rows.size], _taken(ended, slice(rows.size))
        allowed = accuracy * (size_of(coarse - before, length[rows]) + OF_TRAVEL_FINELY * travel[rows])
        error = step * size_of(stepped.difference[: rows.size] + AFTER * last[0], length[rows])
        smooth = apart | (stepped.one_kind[: rows.size] & (last[3] == first[3]))
        agree, after = apart | (smooth & (error <= allowed)), coarse.copy()
        if in_halves.size:
            at_half, half = at[in_halves] + 0.5 * step[in_halves], 0.5 * step[in_halves]
            middle = stepped.pose[rows.size :], at_half, half, _taken(ended, slice(rows.size, None))
            fine, after_fine = _stepped(rate_of, _Begin(rows[in_halves], *middle))
            after[in_halves] = fine.pose
            apart_by = size_of(after - coarse, length[rows])[in_halves]
            agree[in_halves] = ~(apart_by > allowed[in_halves])  # what is not a number ends, too
            for part, values in zip(last, after_fine, strict=True):
                part[in_halves] = values
            # Both are wrong alike where only their last stages have seen a corner: the disc enters the slider.
            deeper = (np.minimum(first[1], 0.0) - last[1] > OF_CORNER * allowed) & (step > SHORTEST_AT_CORNER)
            agree[in_halves] &= ~deeper[in_halves]
        pose[rows], done[rows] = np.where(agree[:, None], after, before), np.where(agree, at + step, at)
        refused = np.where(rough[rows], 0.5, 1.0)  # a step that is not smooth is tried again in halves
        longest[rows] = np.minimum(np.where(agree, 2.0, refused) * step, LONGEST_STEP)
        rough[rows] = ~(agree & smooth)
        first = _merged(agree, last, first)
        on = travel[rows] - done[rows] > 1e-12 * travel[rows]
        rows, first = rows[on], _taken(first, on)
    return pose


class _Begin(NamedTuple):
    """Where steps begin: rows, poses (k, 3), travel done (k,) m, lengths of the steps (k,) m, and the rates there."""

    rows: IntArray
    pose: Array
    done: Array
    step: Array
    rates: KindRates


class _Stepped(NamedTuple):
    """Poses (k, 3) after steps, the weighted sum of the stages' rates (k, 3), and whether all are of one kind."""

    pose: Array
    difference: Array
    one_kind: BoolArray


def _with_halves(begin: _Begin, chosen: IntArray) -> _Begin:
    """The steps, and after them the first halves of some."""
    rows, pose, done, step, rates = begin
    every = np.concatenate([np.arange(len(rows)), chosen])
    lengths = np.concatenate([step, 0.5 * step[chosen]])
    return _Begin(rows[every], pose[every], done[every], lengths, _taken(rates, every))


def _stepped(rate_of: KindRateOf, begin: _Begin) -> tuple[_Stepped, KindRates]:
    """Steps by Kutta's 3/8 rule, and the rates after them."""
    rows, pose, done, step, (k1, gap, _, kind) = begin
    h = step[:, None]
    k2, _, _, second = rate_of(rows, pose + h / 3.0 * k1, done + step / 3.0)
    k3, _, _, third = rate_of(rows, pose + h * (k2 - k1 / 3.0), done + step / 1.5)
    k4, _, _, fourth = rate_of(rows, pose + h * (k1 - k2 + k3), done + step)
    after = pose + np.where((gap < TOUCHING)[:, None], h / 8.0 * (k1 + 3.0 * (k2 + k3) + k4), 0.0)
    difference = sum(weight * k for weight, k in zip(DIFFERENCE, (k1, k2, k3, k4), strict=True))
    one_kind = (second == kind) & (third == kind) & (fourth == kind)
    return _Stepped(after, np.asarray(difference), one_kind), rate_of(rows, after, done + step)


def _taken(rates: KindRates, rows: IntArray | BoolArray | slice) -> KindRates:
    rate, gap, nearing, kind = (part[rows] for part in rates)
    return rate, gap, nearing, kind


def _merged(chosen: BoolArray, one: KindRates, other: KindRates) -> KindRates:
    """Row by row from `one` where chosen (k,), else from `other`."""
    rate = np.where(chosen[:, None], one[0], other[0])
    gap, nearing, kind = (np.where(chosen, a, b) for a, b in zip(one[1:], other[1:], strict=True))
    return rate, gap, nearing, kind
