# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Maps of the outcome by contact and angle: predictions and recordings in the same cells.

A map is for one speed and one duration. Contacts are folded by the outline's rotational symmetry, as in the models, and
given as arc length. A circle, whose contacts are all equal to a model, is not folded.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from push_predictor.errors import TableError
from push_predictor.evaluation.report.map_conditions import map_covariates
from push_predictor.geometry.outline import Outline
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.types import Array, BoolArray, IntArray

SAME = 0.1  # relative difference of speeds and durations that count as equal
FINE = 48  # cells of a predicted map along either axis
FEWEST = 6  # windows in a cell that is shown
WINDOWS_PER_CELL = 9.0
MOST_CELLS = 8  # along either axis
WIDEST_ANGLE = np.radians(89.0)
ANGLE_STEP = np.radians(5.0)


@dataclass(frozen=True, eq=False)
class Condition:
    """The most common kind of window: median velocity (m/s) and duration (s), and its rows (n,) in the table."""

    velocity: float
    duration: float
    rows: BoolArray


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of a map by their edges: contact (C + 1,) in m along the folded outline, angle (A + 1,) in rad."""

    contact: Array
    angle: Array

    @property
    def shape(self) -> tuple[int, int]:
        """Cells along angle and along contact."""
        return len(self.angle) - 1, len(self.contact) - 1


@dataclass(frozen=True, eq=False)
class PushMap:
    """Mean and sd (A, C, 3) of an outcome (m, m, rad) per cell, NaN where unknown.

    windows, pushes (A, C): their number in each cell of a recorded map, None for a predicted map.
    """

    cells: Cells
    mean: Array
    sd: Array
    windows: IntArray | None = None
    pushes: IntArray | None = None


def commonest_condition(table: PushTable) -> Condition:
    """The windows within 10 % of the most common speed, and of these within 10 % of the most common duration.

    Raises TableError for a table without rows.
    """
    if not len(table):
        raise TableError("0 windows: a map needs at least one")
    near = _commonest(table.inputs[:, 0])
    rows = near.copy()
    rows[near] = _commonest(table.duration[near])
    return Condition(float(np.median(table.inputs[rows, 0])), float(np.median(table.duration[rows])), rows)


def fold_order(outline: Outline) -> int:
    """The number of equal sectors of the outline, 1 for a circle."""
    return max(outline.rotational_symmetry, 1)


def sector_length(outline: Outline) -> float:
    """Length of one sector of the outline, m."""
    return outline.perimeter / fold_order(outline)


def arc_length(outline: Outline, contact: Array) -> Array:
    """Arc length (n,) in m of contacts (n,), counter-clockwise from the start of their sector."""
    order = fold_order(outline)
    if outline.semi_axes is not None:
        return np.asarray((contact * order) % 1.0 * sector_length(outline))
    sector = outline.edge(contact)[0] // (len(outline.vertices) // order)
    return np.clip(contact * order - sector, 0.0, 1.0) * sector_length(outline)


def fine_cells(outline: Outline, table: PushTable) -> Cells:
    """Cells of predicted maps: the whole sector, and the table's range of angles rounded outwards to 5 degrees."""
    return _cells(outline, table, FINE, FINE)


def coarse_cells(outline: Outline, table: PushTable) -> Cells:
    """Cells of recorded maps over the same ranges, with about nine windows each.

    Contacts on a circle share one cell.
    """
    wanted = len(table) / WINDOWS_PER_CELL
    along = 1 if outline.rotational_symmetry == 0 else _whole(np.sqrt(wanted))
    return _cells(outline, table, along, _whole(wanted / along))


def push_map(
    model: PushModel, velocity: float, duration: float, cells: Cells, fixed: Mapping[str, float] | None = None
) -> PushMap:
    """Predictions at the centre of every cell, NaN outside the model's domain.

    fixed: the covariates that an extended model needs, see `map_conditions.fixed_covariates`.
    """
    contact = 0.5 * (cells.contact[1:] + cells.contact[:-1]) / model.rig.outline.perimeter
    angle = 0.5 * (cells.angle[1:] + cells.angle[:-1])
    angles, contacts = np.meshgrid(angle, contact, indexing="ij")
    inputs = np.column_stack([np.full(contacts.size, velocity), contacts.ravel(), angles.ravel()])
    covariates = map_covariates(model.rig.outline, fixed or {}, inputs)
    prediction = model.predict_rows(inputs, np.full(len(inputs), duration), covariates)
    sd = np.sqrt(np.diagonal(prediction.covariance, axis1=1, axis2=2))
    hidden = ~prediction.in_domain[:, None]
    shape = (*cells.shape, len(OUTPUTS))
    mean = np.where(hidden, np.nan, prediction.mean).reshape(shape)
    return PushMap(cells, mean, np.where(hidden, np.nan, sd).reshape(shape))


def recorded_map(outline: Outline, table: PushTable, predicted: Array, cells: Cells) -> PushMap:
    """Mean outcome in every cell, and its root mean square deviation from `predicted` (n, 3) as sd.

    The deviation from each window's own prediction corresponds to the predicted sd. Unlike a sample sd it is not biased
    by the variation of inputs within a cell or by the correlation of windows of one push.
    """
    squared = (table.outcomes - predicted) ** 2
    return _averaged(outline, table, table.outcomes, squared, cells)


def predicted_at_windows(outline: Outline, table: PushTable, mean: Array, variance: Array, cells: Cells) -> PushMap:
    """Predictions for the recorded windows, mean and variance (n, 3), averaged in the same cells."""
    return _averaged(outline, table, mean, variance, cells)


def _averaged(outline: Outline, table: PushTable, values: Array, squares: Array, cells: Cells) -> PushMap:
    shape = (*cells.shape, len(OUTPUTS))
    mean, sd = np.full(shape, np.nan), np.full(shape, np.nan)
    windows, pushes = np.zeros(cells.shape, np.int64), np.zeros(cells.shape, np.int64)
    for cell, rows in _members(outline, table, cells):
        windows[cell], pushes[cell] = rows.size, len(set(table.push_id[rows].tolist()))
        if rows.size >= FEWEST:
            mean[cell] = values[rows].mean(axis=0)
            sd[cell] = np.sqrt(squares[rows].mean(axis=0))
    return PushMap(cells, mean, sd, windows, pushes)


def _commonest(values: Array) -> BoolArray:
    ordered = np.sort(values)
    low, high = values / (1.0 + SAME), values * (1.0 + SAME)
    counts = np.searchsorted(ordered, high, side="right") - np.searchsorted(ordered, low, side="left")
    chosen = np.argmax(counts)
    return np.asarray((values >= low[chosen]) & (values <= high[chosen]))


def _whole(count: float) -> int:
    return int(np.clip(round(count), 1, MOST_CELLS))


def _cells(outline: Outline, table: PushTable, along_contact: int, along_angle: int) -> Cells:
    angle = table.inputs[:, 2]
    low = max(np.floor(angle.min() / ANGLE_STEP) * ANGLE_STEP, -WIDEST_ANGLE)
    high = min(max(np.ceil(angle.max() / ANGLE_STEP) * ANGLE_STEP, low + ANGLE_STEP), WIDEST_ANGLE)
    low, high = min(low, angle.min()), max(high, angle.max())  # no window beyond 89 degrees is dropped
    contact = np.linspace(0.0, sector_length(outline), along_contact + 1)
    return Cells(contact, np.linspace(low, high, along_angle + 1))


def _members(outline: Outline, table: PushTable, cells: Cells) -> Iterator[tuple[tuple[int, int], IntArray]]:
    """Each cell that is not empty, with its rows; a row beyond the last edge by rounding is included."""
    column = _position(cells.contact, arc_length(outline, table.inputs[:, 1]))
    row = _position(cells.angle, table.inputs[:, 2])
    flat = row * cells.shape[1] + column
    for index in np.unique(flat):
        yield divmod(int(index), cells.shape[1]), np.flatnonzero(flat == index)


def _position(edges: Array, values: Array) -> IntArray:
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2).astype(np.int64)
