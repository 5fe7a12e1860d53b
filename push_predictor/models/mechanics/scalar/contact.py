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

"""One contact in plain numbers: the same mathematics as contact_solution, with a start from the last contact."""

from __future__ import annotations

from math import sqrt
from typing import TypeAlias

from push_predictor.models.mechanics.motion.contact_solution import BISECT_EVERY, RESTS, ROOT_STEPS
from push_predictor.models.mechanics.scalar.surface import Twist

# One contact: normal_x, normal_y, normal_arm, left_arm, along, across; see Touch. A class would take longer to make.
ScalarTouch: TypeAlias = tuple[float, float, float, float, float, float]


class LastContact:
    """Where the force lay in the friction cone at the last contact, from 0 at its right edge to 1 at its left.

    slope: change of that share over the change of the lag, 0 if unknown.
    """

    def __init__(self) -> None:
        self.share, self.slope = 0.5, 0.0


# Velocity of the centre of friction, spin times length, and slip: see Driven; RESTS where the disc leaves.
ScalarDriven: TypeAlias = tuple[float, float, float, float]
_AT_REST = 0.0, 0.0, 0.0, RESTS


def driven_on_ellipsoid(touch: ScalarTouch, left: float, right: float) -> ScalarDriven:
    """The same as `driven_scalar` on an ellipsoid, where velocity is linear in the force: in closed form.

    A contact that sticks has the force (1, slope) along and left of the normal. Beyond an edge of the friction cone it
    slips, with the force of that edge.
    """
    nx, ny, normal_arm, left_arm, along, across = touch
    if along <= 0.0:
        return _AT_REST
    coupling = normal_arm * left_arm
    push = (1.0 + left_arm * left_arm) * along - coupling * across
    rub = (1.0 + normal_arm * normal_arm) * across - coupling * along
    slip = 0.0
    if rub > left * push if push > 0.0 else rub > 0.0:
        push, rub, slip = 1.0, left, 1.0
    elif rub < -right * push:
        push, rub, slip = 1.0, -right, -1.0
    vx, vy, spin = push * nx - rub * ny, push * ny + rub * nx, push * normal_arm + rub * left_arm
    # Always towards the normal: the map from force to velocity is positive definite and keeps the order of directions.
    size = along / (vx * nx + vy * ny + spin * normal_arm)
    return vx * size, vy * size, spin * size, slip


def driven_scalar(
    twist: Twist, touch: ScalarTouch, left: float, right: float, last: LastContact, tolerance: float
) -> ScalarDriven:
    """The motion with friction `left` and `right` of the normal."""
    nx, ny, normal_arm, left_arm, along, across = touch
    if along <= 0.0:
        return _AT_REST
    a, b = 1.0 / sqrt(1.0 + right * right), 1.0 / sqrt(1.0 + left * left)
    push_right, push_change, rub_right, rub_change = a, b - a, -right * a, left * b + right * a

    def under(share: float) -> tuple[float, float, float, float, float]:
        """Twist, velocity towards the normal, and lag, of a force in the cone."""
        push, rub = push_right + share * push_change, rub_right + share * rub_change
        vx, vy, spin = twist(push * nx - rub * ny, push * ny + rub * nx, push * normal_arm + rub * left_arm)
        toward = vx * nx + vy * ny + spin * normal_arm
        sideways = vy * nx - vx * ny + spin * left_arm
        return vx, vy, spin, toward, (toward if toward > 0.0 else 0.0) * across - sideways * along

    low, high, known_low, known_high = 0.0, 1.0, False, False
    share, before, lag_before = last.share, -1.0, 0.0
    for step in range(1, ROOT_STEPS + 1):
        vx, vy, spin, toward, lag = under(share)
        if (
            abs(lag) <= tolerance * toward
            or high - low <= tolerance
            or (share == 1.0 and lag > 0.0)
            or (share == 0.0 and lag < 0.0)
        ):
            break
        if lag > 0.0:
            low, known_low = share, True
        else:
            high, known_high = share, True
        if before >= 0.0 and lag != lag_before:
            last.slope = (share - before) / (lag - lag_before)
        before, lag_before = share, lag
        share -= lag * last.slope if last.slope < 0.0 else (-1.0 if lag > 0.0 else 1.0)
        if share >= high and not known_high:
            share = 1.0
        elif share <= low and not known_low:
            share = 0.0
        elif not low < share < high or step % BISECT_EVERY == 0:
            share = 0.5 * (low + high)
    last.share = share
    if toward <= 0.0:
        return _AT_REST
    size = along / toward
    return vx * size, vy * size, spin * size, 1.0 if share == 1.0 else -1.0 if share == 0.0 else 0.0
