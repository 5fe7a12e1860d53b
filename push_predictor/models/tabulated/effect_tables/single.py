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

"""Effects of one push from their table, in plain numbers: arrays of one row take several times as long."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from math import acos, atan2, inf, isfinite, pi

import numpy as np

from push_predictor.models.effects.driver_basis import columns_of
from push_predictor.models.effects.scalar_effects import Columns, ScalarEffects
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors import Shift
from push_predictor.models.tabulated.effect_tables.axes import SAME, STEPPED
from push_predictor.models.tabulated.effect_tables.table import MARGIN, TURN, EffectTable


class SingleEffects:
    """The mean and the covariance that a table's effects give one push; the same as EffectTable.shift, to rounding."""

    def __init__(self, table: EffectTable) -> None:
        source, known = table.source, table.source.predictor.coefficients
        self._table = table
        effects, spreads = source.predictor.effects, source.spreads.tolist()
        self._effects = ScalarEffects(effects, source.names, spreads)
        stepped = [effect.basis.name in STEPPED for effect in effects]
        self._stepped = [k for k, steps in enumerate(stepped) if steps]
        self._flowing = [k for k, steps in enumerate(stepped) if not steps]
        self._centre = table.change.centre.tolist()
        self._levels, change = table.change.levels.tolist(), table.change
        self._sides = list(zip(change.directions.tolist(), change.low.tolist(), change.high.tolist(), strict=True))
        self._rows = 1 + known.parameter  # of the spline's values, after the shift
        self._linear = known.values * known.linear if known.linear.any() else None
        self._linear_ends = list(_ends_of_linear(table))
        outline, self._edges = table.place.outline, table.place.edges
        starts = outline.edge_starts
        self._starts = list(zip(starts[:-1].tolist(), (1.0 / np.diff(starts)).tolist(), strict=True))
        self._smooth = outline.semi_axes is not None
        normals = np.zeros((1, 2)) if self._smooth else outline.inward_normal(0.5 * (starts[1:] + starts[:-1]))
        self._normal_angles = np.arctan2(normals[:, 1], normals[:, 0]).tolist()

    def shift(self, push: Push) -> Shift | None:
        """The shift at one push (n = 1), see EffectTable.shift; None where the table does not contain the push."""
        (velocity, contact, angle), table = push.inputs[0].tolist(), self._table
        ratio = float(push.duration[0]) / table.source.duration
        speed = velocity * ratio
        (least, most), (low, high) = table.angles, table.speeds
        inside = least - MARGIN <= angle <= most + MARGIN and low - MARGIN * high <= speed <= high * (1.0 + MARGIN)
        if not inside or not (table.any_duration or abs(ratio - 1.0) <= MARGIN):
            return None
        given = {name: float(column[0]) for name, column in push.covariates.items()}
        if not isfinite(sum(given.values())):
            return None
        side, edge, place = self._located(contact)
        point = [place, min(max(angle, least), most)]
        if table.by_speed:
            point.append(min(max(speed, low), high))
        if table.by_heading:
            heading = self._heading(contact, side, angle, given)
            if heading is None:
                return None
            point.append(heading)
        columns = self._effects.columns(given)
        level = self._changed(columns, point)
        if level is None or not self._in_linear_range(columns):
            return None
        box, known = edge * len(self._levels) + level, table.source.predictor.coefficients
        values = (speed * table.spline.at(point, box)).reshape(-1, 3)
        mean, design = values[0], values.take(self._rows, axis=0) * self._effects.design(columns)
        if self._linear is not None:
            mean = mean + self._linear @ design
        return Shift(mean[None], design.T.dot(known.covariance).dot(design)[None])

    def _in_linear_range(self, columns: Columns) -> bool:
        return all(
            low <= value <= high
            for effect, ends in self._linear_ends
            for value, (low, high) in zip(columns[effect], ends, strict=True)
        )

    def _located(self, contact: float) -> tuple[int, int, float]:
        """The edge of a contact, its number among those that differ, and the place on it; see PlaceAxis."""
        if self._smooth:
            return 0, 0, self._table.place.order * contact % 1.0
        side = bisect_right(self._starts, (contact, inf)) - 1
        start, per_length = self._starts[side]
        fraction = min(max((contact - start) * per_length, 0.0), 1.0)
        return side, side % self._edges, acos(1.0 - 2.0 * fraction) / pi

    def _heading(self, contact: float, side: int, angle: float, given: Mapping[str, float]) -> float | None:
        """See EffectTable; None where slider and push disagree."""
        of_push = given["push_heading"] - angle if "push_heading" in given else None
        if "slider_heading" not in given:
            return None if of_push is None else _turned(of_push)
        normal = self._normal_angles[side]
        if self._smooth:
            (x, y) = self._table.place.outline.inward_normal(np.array([contact]))[0].tolist()
            normal = atan2(y, x)
        heading = given["slider_heading"] + normal
        if of_push is not None and abs(_turned(of_push - heading)) > MARGIN:
            return None
        return _turned(heading)

    def _changed(self, columns: Columns, point: list[float]) -> int | None:
        """The level of the changes, with their places appended to the point; None where they are not in the table."""
        flowing = self._effects.changes(columns, self._flowing)
        away = [change - centre for change, centre in zip(flowing, self._centre, strict=True)]
        for direction, low, high in self._sides:
            place = sum([a * d for a, d in zip(away, direction, strict=True)])
            if not low - SAME <= place <= high + SAME:
                return None
            away = [a - place * d for a, d in zip(away, direction, strict=True)]
            point.append(min(max(place, low), high))
        if away and not max(map(abs, away)) <= SAME:
            return None
        stepped = self._effects.changes(columns, self._stepped)
        for level, known in enumerate(self._levels):
            if all(abs(change - other) <= SAME for change, other in zip(stepped, known, strict=True)):
                return level
        return None


def _ends_of_linear(table: EffectTable) -> Iterator[tuple[int, list[tuple[float, float]]]]:
    """The number of each effect that is linear in its coefficients, and the ends of its basis values in the table."""
    start, (low, high) = 0, table.linear_range
    for k, effect in enumerate(table.source.predictor.effects):
        if not effect.exact:
            own = slice(start, start + columns_of(effect.basis))  # the same for each of its parameters
            yield k, list(zip(low[own].tolist(), high[own].tolist(), strict=True))
            start += len(effect.coefficients)


def _turned(angle: float) -> float:
    return (angle + pi) % TURN - pi
