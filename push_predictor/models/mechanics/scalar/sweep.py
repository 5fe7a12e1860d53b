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

"""The sweep of a disc along its path in plain numbers: see motion.sweep and motion.fine_sweep."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import TypeAlias

from push_predictor.models.mechanics.motion.fine_sweep import (
    AFTER,
    DIFFERENCE,
    OF_CORNER,
    OF_TRAVEL_FINELY,
    SHORTEST_AT_CORNER,
)
from push_predictor.models.mechanics.motion.sweep import LONGEST_STEP, OF_TRAVEL, SHORTEST_STEP, TOUCHING
from push_predictor.models.mechanics.scalar.surface import Three

AT_REST = (0.0, 0.0, 0.0)

# Velocity x, y and turn per distance of the path, gap, how fast it closes, and the kind of contact: see RateAndKind.
Rates: TypeAlias = tuple[float, float, float, float, float, float]
Rate: TypeAlias = Callable[[float, float, float, float], Rates]  # at a pose x, y, heading and a distance along the path


def swept(rate: Rate, travel: float, length: float, accuracy: float) -> Three:
    """Pose after the sweep; see sweep.swept."""
    x = y = heading = done = 0.0
    step, shortest = min(travel, LONGEST_STEP), SHORTEST_STEP * accuracy * LONGEST_STEP
    first = rate(x, y, heading, done) if travel > 0.0 else None
    while first is not None and travel - done > 1e-12 * travel:
        h, (ax, ay, aw, gap, nearing, _) = min(step, travel - done), first
        apart = gap >= TOUCHING
        if apart and nearing > 0.0:
            h = min(h, gap)
        k = 0.0 if apart else h
        bx, by, bw, *_ = rate(x + 0.5 * k * ax, y + 0.5 * k * ay, heading + 0.5 * k * aw, done + 0.5 * h)
        cx, cy, cw, *_ = rate(x + 0.75 * k * bx, y + 0.75 * k * by, heading + 0.75 * k * bw, done + 0.75 * h)
        part = k / 9.0
        mx, my = part * (2.0 * ax + 3.0 * bx + 4.0 * cx), part * (2.0 * ay + 3.0 * by + 4.0 * cy)
        mw = part * (2.0 * aw + 3.0 * bw + 4.0 * cw)
        last = rate(x + mx, y + my, heading + mw, done + h)
        part = k / 72.0
        ex = part * (-5.0 * ax + 6.0 * bx + 8.0 * cx - 9.0 * last[0])
        ey = part * (-5.0 * ay + 6.0 * by + 8.0 * cy - 9.0 * last[1])
        ew = part * (-5.0 * aw + 6.0 * bw + 8.0 * cw - 9.0 * last[2]) * length
        allowed = accuracy * (sqrt(mx * mx + my * my + (mw * length) ** 2) + OF_TRAVEL * travel)
        ratio = sqrt(ex * ex + ey * ey + ew * ew) / allowed
        if not ratio > 1.0 or h <= shortest:  # what is not a number ends, too
            x, y, heading, done, first = x + mx, y + my, heading + mw, done + h, last
        factor = min(max(0.9 * max(ratio, 1e-3) ** (-1.0 / 3.0), 0.2), 4.0)
        step = min(max(h * factor, shortest), LONGEST_STEP)
    return x, y, heading


def swept_finely(rate: Rate, travel: float, length: float, accuracy: float) -> Three:
    """Pose after the sweep; see fine_sweep.swept_finely."""
    pose, done, longest, rough = (0.0, 0.0, 0.0), 0.0, min(travel, LONGEST_STEP), False
    first = rate(*pose, done) if travel > 0.0 else None
    while first is not None and travel - done > 1e-12 * travel:
        step, gap = min(longest, travel - done), first[3]
        apart = gap >= TOUCHING
        if apart and first[4] > 0.0:
            step = min(step, gap)
        after, difference, one_kind = _advance(rate, pose, done, step, first)
        last = rate(*after, done + step)
        allowed = accuracy * (_distance(after, pose, length) + OF_TRAVEL_FINELY * travel)
        smooth = apart or (one_kind and last[5] == first[5])
        if rough or not (apart or (smooth and step * _size(difference, last, length) <= allowed)):
            fine = _in_halves(rate, pose, done, step, first)
            after_fine = rate(*fine, done + step)
            deeper = min(gap, 0.0) - after_fine[3] > OF_CORNER * allowed and step > SHORTEST_AT_CORNER
            if deeper or _distance(fine, after, length) > allowed:
                longest, rough = 0.5 * step, True
                continue
            after, last = fine, after_fine
        pose, done, longest, rough, first = after, done + step, min(2.0 * step, LONGEST_STEP), not smooth, last
    return pose


def _in_halves(rate: Rate, pose: Three, done: float, step: float, first: Rates) -> Three:
    """Pose after a step, in two halves."""
    half = done + 0.5 * step
    middle = _advance(rate, pose, done, 0.5 * step, first)[0]
    return _advance(rate, middle, half, 0.5 * step, rate(*middle, half))[0]


def _advance(rate: Rate, pose: Three, done: float, step: float, first: Rates) -> tuple[Three, Three, bool]:
    """Pose after one step by Kutta's 3/8 rule, and what the last rate is compared with; see fine_sweep. Whether all
    stages have contacts of one kind. first: the rates where it begins.
    """
    x, y, heading = pose
    ax, ay, ah, gap, _, kind = first
    if gap >= TOUCHING:
        return pose, AT_REST, True
    third = step / 3.0
    bx, by, bh, _, _, second = rate(x + third * ax, y + third * ay, heading + third * ah, done + third)
    at_x, at_y, at = x + step * bx - third * ax, y + step * by - third * ay, heading + step * bh - third * ah
    cx, cy, ch, _, _, later = rate(at_x, at_y, at, done + 2.0 * third)
    at_x, at_y, at = x + step * (ax - bx + cx), y + step * (ay - by + cy), heading + step * (ah - bh + ch)
    dx, dy, dh, _, _, fourth = rate(at_x, at_y, at, done + step)
    part = 0.125 * step
    after = (
        x + part * (ax + 3.0 * (bx + cx) + dx),
        y + part * (ay + 3.0 * (by + cy) + dy),
        heading + part * (ah + 3.0 * (bh + ch) + dh),
    )
    p, q, r, s = DIFFERENCE
    difference = (
        p * ax + q * bx + r * cx + s * dx,
        p * ay + q * by + r * cy + s * dy,
        p * ah + q * bh + r * ch + s * dh,
    )
    return after, difference, second == kind and later == kind and fourth == kind


def _distance(one: Three, other: Three, length: float) -> float:
    x, y, turn = one[0] - other[0], one[1] - other[1], (one[2] - other[2]) * length
    return sqrt(x * x + y * y + turn * turn)


def _size(difference: Three, last: Rates, length: float) -> float:
    """Of the difference of rates, with that after the step."""
    x, y, turn = difference[0] + AFTER * last[0], difference[1] + AFTER * last[1], difference[2] + AFTER * last[2]
    return sqrt(x * x + y * y + turn * turn * length * length)
