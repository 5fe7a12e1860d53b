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

"""Direction-dependent friction: a point at velocity u resists with W^-1 u over the root of u' W^-1 u.

W = [[1 + a, b], [b, 1 - a]]. With its root R, isotropic friction resists at the velocity R^-1 u, and the load f becomes
R f. A body whose points have the arms r is then one with the arms R r / det R under the same moments.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from push_predictor.models.mechanics.limit_surfaces.surfaces import DIRECTIONS
from push_predictor.models.mechanics.motion.contact_solution import Rows
from push_predictor.models.mechanics.pressure import PressureDistribution
from push_predictor.types import Array

MOST_STRETCH = 0.95  # of the length of (a, b): at 1 the friction along one direction is infinite
_TURN = 2.0 * np.pi / DIRECTIONS * np.arange(DIRECTIONS)
COS, SIN = np.cos(_TURN), np.sin(_TURN)  # of twice the direction of an arm


class Root(NamedTuple):
    """Of W (k,) each: a and b; xx, xy, yy of the root R; by how much less the arms' length grows, as a factor."""

    a: Array
    b: Array
    xx: Array
    xy: Array
    yy: Array
    turn: Array

    def of(self, rows: Rows) -> Root:
        """Those of some of the rows."""
        return Root(*(part[rows] for part in self))

    def times(self, x: Array, y: Array, m: Array) -> tuple[Array, Array, Array]:
        """R times forces or velocities, and moments or spins in units of the stretched arms."""
        return self.xx * x + self.xy * y, self.xy * x + self.yy * y, self.turn * m


def root_of(stretch: Array, reach: Array) -> Root:
    """The root for each stretch (k, 2: a, b), at most MOST_STRETCH long; reach (k, DIRECTIONS): of the pressure."""
    size = np.sqrt(np.sum(stretch * stretch, axis=1))
    a, b = (stretch * np.minimum(1.0, MOST_STRETCH / np.maximum(size, MOST_STRETCH))[:, None]).T
    determinant = np.sqrt(1.0 - a * a - b * b)
    trace = np.sqrt(2.0 + 2.0 * determinant)
    arms = np.sqrt(1.0 + a[:, None] * COS + b[:, None] * SIN)
    turn = determinant / np.sum(reach * arms, axis=1)
    return Root(a, b, (1.0 + a + determinant) / trace, b / trace, (1.0 - a + determinant) / trace, turn)


def stretched_arms(centred: PressureDistribution, a: float, b: float) -> PressureDistribution:
    """The distribution about its centre with the arms R r: their size does not change the shape of a surface."""
    root = root_of(np.array([[a, b]]), np.full((1, DIRECTIONS), 1.0 / DIRECTIONS))
    x, y = centred.points.T
    arms = np.column_stack([root.xx * x + root.xy * y, root.xy * x + root.yy * y])
    return PressureDistribution(arms, centred.shares, centred.spread)
