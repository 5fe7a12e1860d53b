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

"""Building a table of effects: which axes matter, and how many knots."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from functools import cache, partial

import numpy as np

from push_predictor.models.effects.covariate_range import CUMULATIVE
from push_predictor.models.mechanics.fitted import RECORDING
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.effect_tables.accuracy import (
    CHECKED,
    HALF,
    MOST,
    RECHECKED,
    Sample,
    accepted,
    errors_of,
    later_pushes,
    samples,
)
from push_predictor.models.tabulated.effect_tables.axes import STEPPED, ChangeAxes, PlaceAxis, change_axes
from push_predictor.models.tabulated.effect_tables.table import (
    MARGIN,
    EffectAxes,
    EffectSource,
    EffectTable,
    basis_columns,
)
from push_predictor.models.tabulated.interpolation import Axis, TensorSpline
from push_predictor.types import Array

CELLS = {"place": 40.0, "angle": 80.0, "heading": 16.0, "change": 10.0, "change, later": 20.0}
SPEED_CELLS = 3  # displacement per speed is nearly a parabola of the speed
FEWEST_CELLS, FINEST = 4, 2.0  # cells of an axis; factor on CELLS
COARSEST = 0.2  # factor on CELLS, below which a table is not tried
# Integrations for a table (some microseconds each), and the share of the tolerances that its errors may take. Tried in
# turn: a coarse table saves seconds, but must be accurate to half the tolerances.
ATTEMPTS = ((50_000, 0.5), (200_000, 1.0), (800_000, 1.0))
ANYWHERE = 0.37  # of the perimeter: how far a circle is turned to see whether that matters
PROBES = 64  # random pushes that show which axes matter
ALIKE = 1e-4  # of the largest value


def build_effect_table(model: PushModel) -> tuple[EffectTable | None, str]:
    """A table of an extended model's effects, None if there is none, with the reason in words.

    If it is accurate there too, it also contains later pushes, as of a session twice as long as the training.
    """
    predictor = model.predictor
    assert isinstance(predictor, ExtendedPredictor)
    if (reason := _untabulated(model)) is not None:
        return None, f"exact: {reason}"
    grows = _grows(predictor)
    builder, known, how = cache(partial(_builder, model)), list[Sample](), ""
    for work, share, later in _attempts(grows):
        if (axes := builder(later)) is None:
            continue
        if (table := axes.table(work)) is None:
            how += "; a table would need too many knots"
            continue
        known = known or samples(model, grows, CHECKED)
        errors = errors_of(table, known[: 1 + later], MOST)
        found = f"table of {table.spline.knots} knots{', with later pushes' if later else ''}, {errors}"
        if accepted(errors, share):
            return table, found
        how += f"; a {found}"
    return None, f"exact{how or ': the changes take too many values'}"


def effect_table_from(model: PushModel, spline: TensorSpline, later: bool) -> EffectTable | None:
    """A table of a spline that was built before; None unless it agrees with the model. later: see EffectAxes. Raises
    ValueError or IndexError if it does not fit the model.
    """
    if _untabulated(model) or (builder := _builder(model, later)) is None:
        return None
    table = builder.with_spline(spline)
    return table if accepted(errors_of(table, samples(model, later, RECHECKED), HALF)) else None


def _untabulated(model: PushModel) -> str | None:
    """The reason why there can be no table, whatever its axes; None if there may be one."""
    if RECORDING in model.predictor.needs:
        return "the mechanics depend on the recording"
    return None if len(model.training) else "there are no training pushes"


def _attempts(grows: bool) -> Iterator[tuple[int, float, bool]]:
    """Work, share of the tolerances, and whether to include later pushes, which are worth neither the finest table nor
    a coarse one without them.
    """
    last = len(ATTEMPTS) - 1
    for k, (work, share) in enumerate(ATTEMPTS):
        if grows and (k < last or last == 0):
            yield work, share, True
        if not grows or k > 0 or last == 0:
            yield work, share, False


def _builder(model: PushModel, later: bool) -> _Builder | None:
    """The axes of a table; None if the changes take too many values."""
    predictor, rows = model.predictor, model.training
    assert isinstance(predictor, ExtendedPredictor)
    source = EffectSource(predictor, model.usual_duration)
    known = Push(rows.inputs, rows.duration, rows.covariates)
    push = predictor.completed(_and_later(known) if later else known)
    change = change_axes(*source.changes(push))
    return None if change is None else _Builder.of(source, push, change, later)


def _grows(predictor: ExtendedPredictor) -> bool:
    """Whether an effect changes as a session continues."""
    bases = (effect.basis for effect in predictor.effects if effect.basis.name not in STEPPED)
    return any(driver in CUMULATIVE for basis in bases for driver in basis.drivers)


def _and_later(push: Push) -> Push:
    """These pushes, followed by the same later."""
    later = later_pushes(push)
    columns = {name: np.append(column, later.covariates[name]) for name, column in push.covariates.items()}
    return Push(np.tile(push.inputs, (2, 1)), np.tile(push.duration, 2), columns)


class _Builder(EffectAxes):
    """Tables with these axes."""

    @classmethod
    def of(cls, source: EffectSource, push: Push, change: ChangeAxes, later: bool) -> _Builder:
        """The axes that pushes need."""
        speed = push.inputs[:, 0] * push.duration / source.duration
        angle = push.inputs[:, 2]
        outline = source.predictor.physics.outline
        whole = PlaceAxis(outline, 1)
        ends = (float(angle.min()), float(angle.max())), (float(speed.min()), float(speed.max()))
        linear = basis_columns(source.predictor, push)[:, source.predictor.coefficients.linear]
        margin = MARGIN * np.abs(linear).max(axis=0)
        linear_range = linear.min(axis=0) - margin, linear.max(axis=0) + margin
        plain = cls(source, later, whole, change, linear_range, *ends, True, True)
        inputs, heading, changes = plain._probes()

        def values(where: Array, towards: Array = heading, by: EffectSource = source) -> Array:
            moved = by.moved(where, towards, changes)
            return np.concatenate([moved, by.still(where, towards), by.slopes(where, towards, changes)], axis=1)

        here, twice = values(inputs), replace(source, duration=2.0 * source.duration)
        elsewhere, order = inputs.copy(), outline.rotational_symmetry
        elsewhere[:, 1] = (inputs[:, 1] + (ANYWHERE if order == 0 else 1.0 / order)) % 1.0
        return replace(
            plain,
            place=PlaceAxis(outline, order) if order != 1 and _alike(here, values(elsewhere)) else whole,
            by_heading=not _alike(here, values(inputs, heading + 1.0)),
            any_duration=_alike(here, values(inputs * [0.5, 1.0, 1.0], by=twice)),
        )

    def _probes(self) -> tuple[Array, Array, Array]:
        rng = np.random.default_rng(0)
        low, high = np.array([self.speeds[0], 0.0, self.angles[0]]), np.array([self.speeds[1], 1.0, self.angles[1]])
        places = rng.uniform(self.change.low, self.change.high, (PROBES, len(self.change.low)))
        level = rng.integers(len(self.change.levels), size=PROBES)
        heading = rng.uniform(-np.pi, np.pi, PROBES)
        return rng.uniform(low, high, (PROBES, 3)), heading, self.change.changes(level, places)

    def table(self, work: int) -> EffectTable | None:
        """The finest table for this work; None if it would be too coarse to try.

        The derivatives take more integrations, and are computed at fewer knots.
        """
        parameters = max(len(self.source.names), 1)
        fine, coarse = self._factor(work, 1), self._factor(work, 2 * parameters)
        if coarse < COARSEST:
            return None
        axes = self._axes(fine)
        moved = TensorSpline.through(axes, self._at_knots(axes, self._moved))
        slopes = TensorSpline.through(axes, self._at_knots(self._axes(coarse), self.source.slopes))
        together = np.concatenate([moved.coefficients, slopes.coefficients], axis=-1)
        return self.with_spline(TensorSpline(axes, together.astype(np.float32)))

    def with_spline(self, spline: TensorSpline) -> EffectTable:
        """The table with this spline."""
        return EffectTable(**{field.name: getattr(self, field.name) for field in fields(EffectAxes)}, spline=spline)

    def _at_knots(self, axes: list[Axis], values: Callable[[Array, Array, Array], Array]) -> Array:
        """The values (boxes, cells_1 + 1, ..., cells_D + 1, K), per speed, at the knots of these axes."""
        boxes = self.place.edges * len(self.change.levels)
        knots = [np.linspace(axis.low, axis.high, axis.cells + 1) for axis in axes]
        grid = np.stack(np.meshgrid(np.arange(float(boxes)), *knots, indexing="ij"), axis=-1)
        columns = list(grid.reshape(-1, grid.shape[-1]).T)
        box = columns.pop(0).astype(np.int64)
        contact, angle = self.place.contact(box // len(self.change.levels), columns.pop(0)), columns.pop(0)
        speed = columns.pop(0) if self.by_speed else np.full(len(box), np.mean(self.speeds))
        heading = columns.pop(0) if self.by_heading else np.zeros(len(box))
        places = np.column_stack(columns) if columns else np.empty((len(box), 0))
        changes = self.change.changes(box % len(self.change.levels), places)
        found = values(np.column_stack([speed, contact, angle]), heading, changes) / speed[:, None]
        return np.asarray(found.reshape(*grid.shape[:-1], -1))

    def _moved(self, inputs: Array, heading: Array, changes: Array) -> Array:
        """Shift (n, 3) at knots; its part without changes is computed once for those that differ in changes alone."""
        moved = self.source.moved(inputs, heading, changes)
        apart = int(np.argmax(np.any(np.diff(np.column_stack([inputs, heading]), axis=0) != 0.0, axis=1))) + 1
        index = np.arange(len(inputs)).reshape(self.place.edges, len(self.change.levels), -1, apart)
        first = index[:, :1, :, :1].ravel()
        still = self.source.still(inputs[first], heading[first])
        together = moved.reshape(*index.shape, 3) + still.reshape(self.place.edges, 1, -1, 1, 3)
        return np.asarray(together.reshape(-1, 3))

    def _factor(self, work: int, each: int) -> float:
        """Factor on CELLS that takes this work, with `each` integrations for a knot."""
        free = [CELLS["place"], CELLS["angle"]] + [CELLS["heading"]] * self.by_heading
        free += [CELLS[self._change]] * len(self.change.low)
        each *= self.place.edges * len(self.change.levels) * (SPEED_CELLS + 1 if self.by_speed else 1)
        return float(min((work / (each * float(np.prod(free)))) ** (1.0 / len(free)), FINEST))

    def _axes(self, factor: float) -> list[Axis]:
        def cells(name: str) -> int:
            return max(FEWEST_CELLS, round(factor * CELLS[name]))

        axes = [Axis(0.0, 1.0, cells("place")), Axis(*self.angles, cells("angle"))]
        axes += [Axis(*self.speeds, SPEED_CELLS)] * self.by_speed
        axes += [Axis(-np.pi, np.pi, cells("heading"))] * self.by_heading
        ends = zip(self.change.low.tolist(), self.change.high.tolist(), strict=True)
        return [*axes, *(Axis(low, high, cells(self._change)) for low, high in ends)]

    @property
    def _change(self) -> str:
        return "change, later" if self.later else "change"


def _alike(one: Array, other: Array) -> bool:
    """Whether values (n, k) agree, next to the largest of each column."""
    return bool(np.all(np.abs(one - other) <= ALIKE * np.abs(one).max(axis=0) + np.finfo(float).tiny))
