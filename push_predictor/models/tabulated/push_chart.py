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

"""Where a push lies in a box of velocity, place on the outline and angle; one box for each edge that differs.

The place is a fraction of an edge of a polygon, or of the part of a smooth outline that its symmetry repeats. In these
coordinates a model's predictions are smooth; `features.push_features` is what its kernels compare.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from push_predictor.geometry.outline import Outline
from push_predictor.models.features import EDGE_SPACING
from push_predictor.types import Array, IntArray


class Chart(Protocol):
    """One kind of outline."""

    @property
    def boxes(self) -> int:
        """How many edges differ."""

    @property
    def place_columns(self) -> tuple[int, ...]:
        """The columns of the features that the place becomes."""

    def place(self, contact: Array) -> tuple[Array, IntArray]:
        """Places (n,) and boxes of contacts (n,) in [0, 1)."""

    def place_features(self, place: Array, box: IntArray) -> tuple[Array, ...]:
        """The features of places (n,), column by column."""

    def place_range(self, places: Array) -> tuple[float, float]:
        """The part of its axis that a domain around places (m,) can reach."""


def push_chart(outline: Outline) -> Chart:
    """The chart of an outline."""
    if outline.rotational_symmetry == 0:
        return CircleChart()
    return SmoothChart(outline.rotational_symmetry) if outline.semi_axes is not None else PolygonChart(outline)


class CircleChart:
    """A circle: the contact makes no difference."""

    boxes = 1
    place_columns: tuple[int, ...] = ()

    def place(self, contact: Array) -> tuple[Array, IntArray]:
        """See Chart."""
        return contact, np.zeros(len(contact), dtype=np.intp)

    def place_features(self, place: Array, box: IntArray) -> tuple[Array, ...]:
        """See Chart."""
        return ()

    def place_range(self, places: Array) -> tuple[float, float]:
        """See Chart."""
        return 0.0, 1.0


@dataclass(frozen=True)
class SmoothChart:
    """A smooth outline of a given rotational symmetry: the place goes once around the part that repeats."""

    order: int
    boxes = 1
    place_columns = (1, 2)

    def place(self, contact: Array) -> tuple[Array, IntArray]:
        """See Chart."""
        return self.order * contact % 1.0, np.zeros(len(contact), dtype=np.intp)

    def place_features(self, place: Array, box: IntArray) -> tuple[Array, ...]:
        """See Chart."""
        turn = 2.0 * np.pi * place
        return np.cos(turn), np.sin(turn)

    def place_range(self, places: Array) -> tuple[float, float]:
        """See Chart: a box of cosine and sine may be in several pieces along the outline."""
        return 0.0, 1.0


class PolygonChart:
    """A polygon: a box for each edge of the part that its symmetry repeats."""

    place_columns = (1,)

    def __init__(self, outline: Outline) -> None:
        self.boxes = len(outline.vertices) // outline.rotational_symmetry
        self._starts, self._per_length = outline.edge_starts, 1.0 / np.diff(outline.edge_starts)

    def place(self, contact: Array) -> tuple[Array, IntArray]:
        """See Chart."""
        edge = self._starts.searchsorted(contact, side="right") - 1
        return (contact - self._starts[edge]) * self._per_length[edge], edge % self.boxes

    def place_features(self, place: Array, box: IntArray) -> tuple[Array, ...]:
        """See Chart."""
        return (np.asarray(EDGE_SPACING * box + place),)

    def place_range(self, places: Array) -> tuple[float, float]:
        """See Chart: where edges differ, the domain contains most of them completely."""
        return (float(places.min()), float(places.max())) if self.boxes == 1 else (0.0, 1.0)
