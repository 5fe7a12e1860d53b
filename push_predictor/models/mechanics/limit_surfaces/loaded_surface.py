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

"""A limit surface under direction-dependent friction, a steady pull, and a push above the table."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from push_predictor.models.mechanics.limit_surfaces.direction_dependence import Root
from push_predictor.models.mechanics.limit_surfaces.load_map import StretchOf
from push_predictor.models.mechanics.limit_surfaces.support_surfaces import PushSurfaces
from push_predictor.models.mechanics.motion.contact_solution import Rows
from push_predictor.types import Array, IntArray

PULL_ROUNDS = 4  # the first is exact on an ellipsoid
SMALLEST_MARGIN = 1e-6  # of a pull to the friction that it cannot overcome alone

Parts: TypeAlias = tuple[Array, Array, Array]  # of a load or a twist


@dataclass(frozen=True, eq=False)
class LoadedSurface:
    """The limit surfaces of some rows (k,), as a pusher feels them.

    root: of the direction-dependent friction. pull (k, 3): a steady load in units of the largest force,
    and of that times the length. height (k,) m: the centre of pressure moves by it along the pusher's force, in units
    of the largest.
    """

    surfaces: PushSurfaces
    rows: IntArray
    root: Root | None = None
    pull: Array | None = None
    height: Array | None = None

    def twist(self, chosen: Rows, force_x: Array, force_y: Array, moment: Array) -> Parts:
        """Twist (vx, vy, w times length) of the centre up to a positive factor, from the pusher's load.

        chosen: those of the rows that the loads are of.
        """
        rows = self.rows[chosen]
        if self.root is None and self.pull is None and self.height is None:
            return self.surfaces.twist(rows, force_x, force_y, moment)
        root = None if self.root is None else self.root.of(chosen)
        load = (force_x, force_y, moment) if root is None else root.times(force_x, force_y, moment)
        factor, (vx, vy, spin) = self._driven(chosen, load)
        if root is not None:
            vx, vy, spin = root.times(vx, vy, spin)
        if self.height is not None:
            shift = self.height[chosen] * factor * spin / self.surfaces.of_rows.length[rows]  # over the force
            vx, vy = vx + shift * force_y, vy - shift * force_x
        return vx, vy, spin

    def _driven(self, chosen: Rows, load: Parts) -> tuple[Array, Parts]:
        """Factor that brings the pusher's load onto the surface (see on_surface), and the twist there."""
        if self._stretched_pull is None and self.height is not None:
            twist, size = self.surfaces.twist_and_gauge(self.rows[chosen], *load, self._stretch(chosen))
            return 1.0 / size, twist
        factor, load = self.on_surface(chosen, load)
        return factor, self.surfaces.twist(self.rows[chosen], *load, self._stretch(chosen))

    def _stretch(self, chosen: Rows) -> StretchOf:
        return None if self.root is None else (self.root.a[chosen], self.root.b[chosen])

    @cached_property
    def _stretched_pull(self) -> Array | None:
        if self.pull is None or self.root is None:
            return None if self.pull is None else self.pull.T
        return np.stack(self.root.times(*self.pull.T))

    def on_surface(self, chosen: Rows, pusher: Parts) -> tuple[Array, Parts]:
        """Factor that brings the pusher's load onto the surface, with the pull, and the load there, as large as given.

        Without a pull the load stays as it is, and nothing needs the factor.
        """
        rows, stretch = self.rows[chosen], self._stretch(chosen)
        if self._stretched_pull is None:
            return np.ones(0), pusher
        pull, given = self._stretched_pull[:, chosen], np.sqrt(sum(part * part for part in pusher))
        x, y, m = (part / given for part in pusher)
        dot, square = x * pull[0] + y * pull[1] + m * pull[2], np.sum(pull * pull, axis=0)
        radius = np.ones(x.shape)
        for _ in range(PULL_ROUNDS):
            share = -dot + np.sqrt(np.maximum(dot * dot + radius * radius - square, SMALLEST_MARGIN))
            load = share * x + pull[0], share * y + pull[1], share * m + pull[2]
            radius = np.sqrt(sum(part * part for part in load)) / self.surfaces.gauge(rows, *load, stretch)
        return share / given, (given * load[0], given * load[1], given * load[2])
