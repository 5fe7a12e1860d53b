# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The maximum of a map over contact and angle, with its uncertainty."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.statistics.grid_maps import ROUNDING, Place, at_places

SURE = 0.95
STEP = 0.1  # of the side, and rad: the paper's grid


@dataclass(frozen=True)
class Peak:
    """The largest value of a map and its place; places: where it falls in 95 % of the draws.

    reach: the value at the named places (mean over them, between the map's points) over the largest.
    """

    value: Estimate
    place: Place
    places: tuple[Place, ...]
    reach: Estimate

    def steps_from(self, named: Sequence[Place]) -> Estimate:
        """Steps of the paper's grid from the nearest of the named places; the interval is over the places."""
        away = [min(max(abs(c - n[0]), abs(a - n[1])) for n in named) / STEP for c, a in (self.place, *self.places)]
        return Estimate(away[0], min(away[1:]), max(away[1:]))


def peak(
    fractions: Array,
    angles: Array,
    shown: Array,
    drawn: Array,
    named: Sequence[Place],
    interval: Callable[[float, Array], Estimate],
) -> Peak:
    """The peak of a map (A, C) with draws (d, A, C), NaN where unknown; named: places of interest."""
    maps = np.concatenate([shown[None], drawn])
    flat = np.where(np.isfinite(maps), maps, -np.inf).reshape(len(maps), -1)
    top, where = flat.max(axis=1), flat.argmax(axis=1)
    reach = at_places(fractions, angles, maps, named).mean(axis=1) / top
    cells = [(float(fractions[i % len(fractions)]), float(angles[i // len(fractions)])) for i in where]
    return Peak(interval(float(top[0]), top[1:]), cells[0], _commonest(cells[1:]), interval(float(reach[0]), reach[1:]))


def _commonest(places: Sequence[Place]) -> tuple[Place, ...]:
    """The fewest places with 95 % of all, the most frequent first."""
    counts = {place: places.count(place) for place in dict.fromkeys(places)}
    ordered = sorted(counts, key=lambda place: -counts[place])
    held = np.cumsum([counts[place] for place in ordered])
    return tuple(ordered[: int(np.searchsorted(held, SURE * len(places) - ROUNDING)) + 1])
