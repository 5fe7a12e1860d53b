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

"""Building a table of effects: which axes matter, how many knots, and how accurate it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.models.effects.covariate_range import CUMULATIVE
from push_predictor.models.mechanics.fitted import RECORDING
from push_predictor.models.mechanisms import Push
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.effect_axes import STEPPED, ChangeAxes, PlaceAxis, change_axes
from push_predictor.models.tabulated.effect_table import EffectSource, EffectTable
from push_predictor.models.tabulated.interpolation import Axis, TensorSpline
from push_predictor.models.tabulated.table_accuracy import relative_error
from push_predictor.types import Array

CELLS = {"place": 40.0, "angle": 80.0, "heading": 16.0, "change": 10.0, "change, later": 20.0}
SPEED_CELLS = 3  # displacement per speed is nearly a parabola of the speed
FEWEST_CELLS, FINEST = 4, 2.0  # cells of an axis; factor on CELLS
COARSEST = 0.2  # factor on CELLS, below which a table is not tried
# Integrations for a table, some microseconds each, and the share of the tolerances that its errors may take: a coarse
# one saves seconds, and is used where it is accurate beyond doubt. Tried in turn.
ATTEMPTS = ((50_000, 0.5), (200_000, 1.0), (800_000, 1.0))
ONE_SPEED = 1.02  # ratio of the largest to the smallest speed, up to which they count as one
ANYWHERE = 0.37  # of the perimeter: how far a circle is turned to see whether that matters
PROBES = 64  # random pushes that show which axes matter
ALIKE = 1e-4  # of the largest value
MEAN_TOLERANCE = 0.2  # predicted standard deviations, in 99 of 100 pushes; the root of the mean square is a fifth of it
COVARIANCE_TOLERANCE = 0.1  # relative, of the variance of any combination of outputs, in 99 of 100 pushes
CHECKED = 400  # pushes: training rows, and as many with other inputs
RECHECKED = 10  # the same, when a table is read


def build_effect_table(model: PushModel) -> tuple[EffectTable | None, str]:
    """A table of an extended model's effects, None if there is none, with the reason in words.

    If it is accurate there too, it also holds the pushes of a session that lasts on, up to twice as long as that of the
    training.
    """
    if (reason := _untabulated(model)) is not None:
        return None, f"exact: {reason}"
    builders = _builders(model)
    if not builders:
        return None, "exact: the changes take too many values"
    how = ""
    for work, share in ATTEMPTS:
        for builder in builders if share == 1.0 else builders[:1]:
            if (table := builder.table(work)) is None:
                how += "; a table would need too many knots"
                continue
            errors = table_errors(model, table, builder.later)
            found = f"table of {table.spline.knots} knots, {errors}"
            if errors.within(share):
                return table, found
            how += f"; a {found}"
    return None, f"exact{how}"


def effect_table_from(model: PushModel, spline: TensorSpline) -> EffectTable | None:
    """A table of a spline that was built before; None unless it agrees with the model. Raises ValueError or IndexError
    if it does not fit the model.
    """
    builders = [] if _untabulated(model) else _builders(model)
    for builder in builders:
        if not builder.fits(spline):
            continue
        table = builder.with_spline(spline)
        return table if table_errors(model, table, builder.later, RECHECKED, 0.5).within(1.0) else None
    return None


def _untabulated(model: PushModel) -> str | None:
    """In words, why there can be no table, as far as that does not take its axes."""
    if RECORDING in model.predictor.needs:
        return "the mechanics depend on the recording"
    return None if len(model.training) else "there are no training pushes"


def _builders(model: PushModel) -> list[_Builder]:
    """The axes of tables, those of the widest table first; none where the changes take too many values."""
    predictor, rows = model.predictor, model.training
    assert isinstance(predictor, ExtendedPredictor)
    source = EffectSource(predictor, model.usual_duration)
    known = Push(rows.inputs, rows.duration, rows.covariates)
    found = []
    for later in (True, False) if _grows(predictor) else (False,):
        push = predictor.completed(_and_later(known) if later else known)
        if (change := change_axes(*source.changes(push))) is not None:
            found.append(_Builder.of(source, push, change, later))
    return found


def _grows(predictor: ExtendedPredictor) -> bool:
    """Whether changes go on while a session lasts on."""
    flowing = (effect.basis for effect in predictor.effects if effect.exact and effect.basis.name not in STEPPED)
    return any(driver in CUMULATIVE for basis in flowing for driver in basis.drivers)


def _and_later(push: Push) -> Push:
    """These pushes, and the same at the end of a session that lasts on, twice as long."""
    later = _later(push)
    columns = {name: np.append(column, later.covariates[name]) for name, column in push.covariates.items()}
    return Push(np.tile(push.inputs, (2, 1)), np.tile(push.duration, 2), columns)


def _later(push: Push) -> Push:
    """The same pushes, later by as much as they last."""
    grown = {
        name: column + (column.max() - column.min()) if name in CUMULATIVE else column
        for name, column in push.covariates.items()
    }
    return replace(push, covariates=grown)


@dataclass(frozen=True)
class EffectErrors:
    """Differences of a table and the model: of means, in predicted standard deviations, and of covariances, relative
    (see table_accuracy.TableAccuracy).
    """

    of_mean: float
    of_covariance: float

    def within(self, share: float) -> bool:
        """Whether they take at most this share of the tolerances."""
        return self.of_mean <= share * MEAN_TOLERANCE and self.of_covariance <= share * COVARIANCE_TOLERANCE

    def __str__(self) -> str:
        return f"means to {self.of_mean:.2g} standard deviations, covariances to {100.0 * self.of_covariance:.2g} %"


def table_errors(
    model: PushModel, table: EffectTable, later: bool, checked: int = CHECKED, share: float = 0.99
) -> EffectErrors:
    """The differences that a share of the pushes does not exceed.

    later: whether later pushes are compared as well; their share counts by itself.
    """
    push = _checked(model, checked)
    parts = [push, _later(push)] if later else [push]
    errors = [_errors(model, table, part, share) for part in parts]
    return EffectErrors(max(of_mean for of_mean, _ in errors), max(of_covariance for _, of_covariance in errors))


def _errors(model: PushModel, table: EffectTable, push: Push, share: float) -> tuple[float, float]:
    exact, expected = model.predictor.moments(push), model.predictor.shift(push)
    found = table.shift(push, table.located(push))
    sd = np.sqrt(np.diagonal(exact.covariance, axis1=1, axis2=2))
    of_mean = np.abs(found.mean - table.source.anchor(push) - expected.mean) / sd
    of_covariance = relative_error(exact.covariance - expected.covariance + found.covariance, exact.covariance)
    return float(np.quantile(of_mean.max(axis=1), share)), float(np.quantile(of_covariance, share))


def _checked(model: PushModel, count: int) -> Push:
    """Training rows, and rows with inputs drawn evenly between them."""
    rng, rows = np.random.default_rng(0), model.training
    known = rows.take(rng.integers(len(rows), size=2 * count))
    inputs = known.inputs.copy()
    low, high = rows.inputs.min(axis=0), rows.inputs.max(axis=0)
    low[1], high[1] = 0.0, 1.0
    inputs[count:] = rng.uniform(low, high, (count, 3))
    covariates = dict(known.covariates)
    if {"slider_heading", "push_heading"} <= set(covariates):
        normal = model.rig.outline.inward_normal(inputs[:, 1])
        covariates["push_heading"] = (
            covariates["slider_heading"] + np.arctan2(normal[:, 1], normal[:, 0]) + inputs[:, 2]
        )
    return model.predictor.completed(Push(inputs, np.full(len(inputs), model.usual_duration), covariates))


@dataclass(frozen=True, eq=False)
class _Builder:
    """Axes of a table; later: whether it also holds later pushes."""

    source: EffectSource
    place: PlaceAxis
    change: ChangeAxes
    angles: tuple[float, float]
    speeds: tuple[float, float]
    by_heading: bool
    any_duration: bool
    later: bool

    @classmethod
    def of(cls, source: EffectSource, push: Push, change: ChangeAxes, later: bool) -> _Builder:
        """The axes that pushes need."""
        speed = push.inputs[:, 0] * push.duration / source.duration
        angle = push.inputs[:, 2]
        outline = source.predictor.physics.outline
        whole = PlaceAxis(outline, 1)
        ends = (float(angle.min()), float(angle.max())), (float(speed.min()), float(speed.max()))
        plain = cls(source, whole, change, *ends, True, True, later)
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

    @property
    def by_speed(self) -> bool:
        """Whether the speeds differ."""
        return self.speeds[1] > ONE_SPEED * self.speeds[0]

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

    def fits(self, spline: TensorSpline) -> bool:
        """Whether a spline was made for these ranges of changes."""
        ends = [[axis.low, axis.high] for axis in spline.axes[-len(self.change.low) :]] if len(self.change.low) else []
        own = np.column_stack([self.change.low, self.change.high])
        return len(ends) == len(own) and bool(np.allclose(np.reshape(ends, own.shape), own, rtol=1e-6))

    def with_spline(self, spline: TensorSpline) -> EffectTable:
        """The table with this spline."""
        axes = self.place, self.change, self.angles, self.speeds, self.by_speed, self.by_heading, self.any_duration
        return EffectTable(self.source, *axes, spline)

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
