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

"""The noise of repeated pushes: pressure and contact friction vary along every push, and the rest is a share of it.

Bauza and Rodriguez (2017, "A probabilistic data-driven model for planar pushing") find that repeated pushes of a slider
differ by some 10 to 20 % of the motion, and that the spread depends on the push, because friction varies in space and
time. So the noise is that of small changes of the friction and of the centre of pressure, passed through the mechanics:
where a push is sensitive to them, its outcomes differ. A share of the distance travelled and the tracker's noise are
added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.types import Array

VARYING = {"contact_friction": 0.1, "centre_x": 0.004, "centre_y": 0.004}  # standard deviations within a session
SHARE = 0.05  # of the distance travelled, and of the turn that moves a point at the length c that far
TRACKER = (1e-4, 1e-4, 1e-3)  # m, m, rad: of the difference of two poses


@dataclass(frozen=True, eq=False)
class ProcessNoise:
    """factor (3,): on the variances of dx, dy and dtheta; 1 before there are data."""

    factor: Array = field(default_factory=lambda: np.ones(3))

    @staticmethod
    def changed(names: Sequence[str], values: Array) -> Array:
        """Rows (1 + 2 v, p) of parameters: the values (p,), and each of those that vary increased, then decreased."""
        rows = np.tile(values, (1 + 2 * len(VARYING), 1))
        for k, (name, spread) in enumerate(VARYING.items()):
            column, low, high = names.index(name), BY_NAME[name].low, BY_NAME[name].high
            above, below = min(values[column] + spread, high), max(values[column] - spread, low)
            rows[1 + k, column], rows[1 + len(VARYING) + k, column] = above, below
        return rows

    def covariance(self, displacements: Array, travel: Array, length: Array) -> Array:
        """Covariance (n, 3, 3) of the noise.

        displacements (n, 1 + 2 v, 3): under the parameters of `changed`. travel (n,), length c (n,) in m.
        """
        varied = displacements[:, 1:]
        shift = 0.5 * (varied[:, : len(VARYING)] - varied[:, len(VARYING) :])
        covariance = np.einsum("nka,nkb->nab", shift, shift)
        unit = np.column_stack([travel, travel, travel / length])
        index = np.arange(3)
        covariance[:, index, index] += (SHARE * unit) ** 2 + np.square(TRACKER)
        root = np.sqrt(self.factor)
        return np.asarray(covariance * root[:, None] * root)
