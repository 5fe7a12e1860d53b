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

"""The coordinates of a table of effects: where the push touches, its angle and speed, headings, and what has changed.

Effects act by the changes of some parameters of the mechanics. However many covariates and coefficients they have, the
changes of the training rows often take few values, or lie on a line or in a plane: these are the coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.outline import Outline
from push_predictor.types import Array, BoolArray, IntArray

STEPPED = ("constant", "step", "category")  # bases that take a few values
MOST_LEVELS = 4  # combinations of these values, for which a table has a part each
MOST_DIRECTIONS = 2  # in which the other changes vary
SAME = 1e-6  # of a parameter's usual spread
NEXT_TO_CORNER = 1e-6  # of an edge: a corner itself belongs to the next one


@dataclass(frozen=True, eq=False)
class ChangeAxes:
    """Coordinates of changes (n, q), in units of each parameter's spread: a level, and places along directions.

    levels (l, q): what stepped effects change. centre (q,), directions (r, q), orthonormal: of what the others change.
    low, high (r,): of the places.
    """

    levels: Array
    centre: Array
    directions: Array
    low: Array
    high: Array

    def located(self, stepped: Array, flowing: Array) -> tuple[IntArray, Array, BoolArray]:
        """Level (n,) and places (n, r) of changes by stepped and other effects (n, q), and whether they are inside."""
        away = np.abs(stepped[:, None] - self.levels).max(axis=2, initial=0.0)
        from_centre = flowing - self.centre
        places = from_centre @ self.directions.T
        off = np.abs(from_centre - places @ self.directions).max(axis=1, initial=0.0)
        within = ((places >= self.low - SAME) & (places <= self.high + SAME)).all(axis=1)
        inside = (away.min(axis=1) <= SAME) & (off <= SAME) & within
        return away.argmin(axis=1), np.clip(places, self.low, self.high), np.asarray(inside)

    def changes(self, level: IntArray, places: Array) -> Array:
        """The changes (n, q) at levels (n,) and places (n, r)."""
        return np.asarray(self.levels[level] + self.centre + places @ self.directions)


def change_axes(stepped: Array, flowing: Array) -> ChangeAxes | None:
    """Axes for the changes (n, q) of the training rows by stepped and other effects; None if they vary too much."""
    rounded = np.round(stepped / SAME).astype(np.int64)
    levels = stepped[np.unique(rounded, axis=0, return_index=True)[1]]
    centre = flowing.mean(axis=0)
    _, size, directions = np.linalg.svd(flowing - centre, full_matrices=False)
    directions = directions[size > SAME * np.sqrt(len(flowing))]
    if len(levels) > MOST_LEVELS or len(directions) > MOST_DIRECTIONS:
        return None
    places = (flowing - centre) @ directions.T
    return ChangeAxes(levels, centre, directions, places.min(axis=0), places.max(axis=0))


@dataclass(frozen=True, eq=False)
class PlaceAxis:
    """Where a push touches: an edge, and a place on it between 0 and 1; a smooth outline is one edge.

    order: number of parts of the outline that are alike; 0 for a circle that is the same all around.
    """

    outline: Outline
    order: int

    @property
    def edges(self) -> int:
        """Number of edges that differ."""
        if self.outline.semi_axes is not None:
            return 1
        return len(self.outline.vertices) // self.order

    def located(self, contact: Array) -> tuple[IntArray, Array]:
        """Edges and places (n,) of contacts (n,). Places are denser next to corners, where more happens."""
        if self.outline.semi_axes is not None:
            return np.zeros(len(contact), dtype=np.int64), self.order * contact % 1.0
        edge, fraction = self.outline.edge(contact)
        return edge % self.edges, np.arccos(1.0 - 2.0 * fraction) / np.pi

    def contact(self, edge: IntArray, place: Array) -> Array:
        """A contact (n,) at edges and places (n,)."""
        if self.outline.semi_axes is not None:
            return np.asarray(place / max(self.order, 1) % 1.0)
        fraction = 0.5 - 0.5 * np.cos(np.pi * place)
        return self.outline.contact_on_edge(edge, np.clip(fraction, NEXT_TO_CORNER, 1.0 - NEXT_TO_CORNER))
