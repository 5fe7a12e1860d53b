# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Maps of the outcome by contact and angle: predictions and recordings in the same cells.

A map is for one speed and one duration. Contacts are folded by the outline's rotational symmetry, as in the models, and
given as arc length. A circle, whose contacts are all equal to a model, is not folded. The covariates of an extended
model are fixed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.errors import TableError
from push_predictor.geometry.frames import wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.models.effects.covariates import HEADINGS
from push_predictor.models.effects.covariates import UNITS as COVARIATE_UNITS
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.reporting.canvas import EMPTY, UNITS, output_label
from push_predictor.types import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

SAME = 0.1  # relative difference of speeds and durations that count as equal
FINE = 48  # cells of a predicted map along either axis
FEWEST = 6  # windows in a cell that is shown
WINDOWS_PER_CELL = 9.0
MOST_CELLS = 8  # along either axis
WIDEST_ANGLE = np.radians(89.0)
ANGLE_STEP = np.radians(5.0)
CLIPPED = 3.0  # % of a panel's values that may exceed the colour scale at each end
ONE_SIGNED = 0.1  # largest share of the other sign in a scale of one sign
OF_SLIDER, OF_PUSH = HEADINGS


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


@dataclass(frozen=True, eq=False)
class Panel:
    """A column of the figure: title, map, and whether cells show the number of pushes."""

    title: str
    map: PushMap
    counted: bool = False


@dataclass(frozen=True, eq=False)
class ColourScale:
    """The colour scale of a row: limits in shown units, name of the colour map, which ends are clipped."""

    low: float
    high: float
    name: str
    extend: str


def paint_maps(figure: Figure, outline: Outline, panels: Sequence[Panel], quantity: str) -> None:
    """Rows dx, dy, dtheta, a column per panel; quantity is 'mean' or 'sd'."""
    axes = figure.subplots(len(UNITS), len(panels), sharex=True, sharey=True, squeeze=False)
    for k, row in enumerate(axes):
        values = [getattr(panel.map, quantity)[..., k] * UNITS[k] for panel in panels]
        scale = colour_scale(values)
        for ax, panel, shown in zip(row, panels, values, strict=True):
            image = paint_panel(ax, outline, panel.map, shown, scale, panel.counted)
        name = output_label(k) if quantity == "mean" else f"sd of {output_label(k)}"
        figure.colorbar(image, ax=list(row), label=name, extend=scale.extend, pad=0.01, aspect=16, shrink=0.95)
        row[0].set_ylabel("push angle (deg)")
    for ax, panel in zip(axes[0], panels, strict=True):
        ax.set_title(panel.title)
    figure.supxlabel(contact_label(outline), fontsize=9.0)


def paint_panel(
    ax: Axes, outline: Outline, shown: PushMap, values: Array, scale: ColourScale, counted: bool
) -> ScalarMappable:
    """Paint one map of values (A, C) in shown units; unknown cells are grey and hatched."""
    contact, angle = shown.cells.contact * 1e3, np.degrees(shown.cells.angle)
    ax.set_facecolor(EMPTY)
    ax.patch.set_hatch("////")
    coarse = shown.windows is not None
    border = {"edgecolors": "white", "linewidth": 0.4} if coarse else {"rasterized": True}
    image = ax.pcolormesh(contact, angle, values, cmap=scale.name, norm=_norm(scale), **border)
    for corner in inner_corners(outline):
        ax.axvline(corner * 1e3, color="0.25", linewidth=0.6)
    ax.set_xlim(contact[0], contact[-1])
    ax.set_ylim(angle[0], angle[-1])
    for side in ("top", "right"):
        ax.spines[side].set_visible(True)
    if counted and shown.pushes is not None:
        _write_counts(ax, shown, values, image)
    return image


def colour_scale(panels: Sequence[Array]) -> ColourScale:
    """A scale from zero, or symmetric about zero for values of both signs; outlying cells are clipped."""
    known = [values[np.isfinite(values)] for values in panels if np.isfinite(values).any()]
    if not known:
        return ColourScale(0.0, 1.0, "viridis", "neither")
    ends = np.array([np.percentile(values, [CLIPPED, 100.0 - CLIPPED]) for values in known])
    low, high = min(float(ends[:, 0].min()), 0.0), max(float(ends[:, 1].max()), 0.0)
    reach = max(-low, high, 1e-9)
    signed = min(-low, high) > ONE_SIGNED * reach
    low, high = (-reach, reach) if signed else (0.0, reach) if high >= -low else (-reach, 0.0)
    below, above = (any(v.min() < low for v in known), any(v.max() > high for v in known))
    extend = {(True, True): "both", (True, False): "min", (False, True): "max", (False, False): "neither"}
    return ColourScale(low, high, "PuOr" if signed else "viridis", extend[below, above])


def contact_label(outline: Outline) -> str:
    """The label of the contact axis."""
    order = fold_order(outline)
    if outline.semi_axes is None and order == len(outline.vertices):
        return f"contact along the edge, counter-clockwise (mm; all {order} edges shown as one)"
    if order > 1:
        return f"contact along the outline, counter-clockwise (mm; {order} equal parts shown as one)"
    equal = "; the models do not depend on it" if outline.rotational_symmetry == 0 else ""
    return f"contact along the outline, counter-clockwise from its first vertex (mm{equal})"


def inner_corners(outline: Outline) -> Array:
    """Positions (m along a sector) where its edges meet."""
    starts = outline.edge_starts * outline.perimeter
    length = sector_length(outline)
    return starts[(starts > 1e-6 * length) & (starts < (1.0 - 1e-6) * length)]


def _norm(scale: ColourScale) -> Normalize:
    from matplotlib.colors import Normalize

    return Normalize(scale.low, scale.high)


def _write_counts(ax: Axes, shown: PushMap, values: Array, image: ScalarMappable) -> None:
    """Write the number of pushes into every known cell, dark on light and light on dark."""
    contact, angle = shown.cells.contact * 1e3, np.degrees(shown.cells.angle)
    for row, column in np.argwhere(np.isfinite(values)):
        brightness = np.dot(image.to_rgba(values[row, column])[:3], (0.3, 0.6, 0.1))
        middle = contact[column : column + 2].mean(), angle[row : row + 2].mean()
        text = str(shown.pushes[row, column]) if shown.pushes is not None else ""
        ax.text(*middle, text, ha="center", va="center", fontsize=8.0, color="black" if brightness > 0.5 else "white")


def fixed_covariates(model: PushModel, table: PushTable) -> dict[str, float]:
    """The median in the table of each covariate that the model takes; empty if it takes none.

    For a heading it is the value nearest to the mean direction. If the slider's heading is known, it is fixed and the
    push's heading follows from it. Raises KeyError if the table lacks a covariate that the model needs.
    """
    known, given = model.continued(table).covariates, [name for name in model.defaults if name in table.covariates]
    names = [OF_SLIDER if name == OF_PUSH and OF_SLIDER in known else name for name in (*model.needs, *given)]
    return {name: _middle(name, known[name]) for name in names}


def map_covariates(outline: Outline, fixed: Mapping[str, float], inputs: Array) -> dict[str, Array]:
    """The covariates (n,) of the pushes (n, 3) of a map, with these fixed."""
    columns = {name: np.full(len(inputs), value) for name, value in fixed.items()}
    if OF_SLIDER in fixed and OF_PUSH not in fixed:
        normal = outline.inward_normal(inputs[:, 1])
        columns[OF_PUSH] = wrap_angle(fixed[OF_SLIDER] + np.arctan2(normal[:, 1], normal[:, 0]) + inputs[:, 2])
    return columns


def fixed_covariates_text(model: PushModel, fixed: Mapping[str, float]) -> str:
    """Sentences for a caption: the values at which a model's map is drawn, and what that means; empty without them."""
    if not fixed:
        return ""
    values = " and ".join(_value(*pair) for pair in fixed.items())
    sentences = [f"The map of {model.name} is drawn at {values}, the median of these windows."]
    if headings := [name for name in fixed if name in HEADINGS]:
        follows = f" ({OF_PUSH} follows from it)" if OF_PUSH in model.needs and OF_PUSH not in fixed else ""
        sentences.append(f"The {headings[0]} is the one nearest to the mean direction{follows}.")
        sentences.append("At another heading the map differs.")
    for name, value in fixed.items():
        known = model.covariate_ranges.get(name)
        if known is not None and not known.contains(np.array([value]))[0]:
            sentences.append(f"Nothing is drawn: the model was extended on {name} from {known}.")
    return " ".join(sentences)


def _value(name: str, value: float) -> str:
    return f"{name} {value:.3g} {COVARIATE_UNITS.get(name, '')}".rstrip()


def _middle(name: str, values: Array) -> float:
    if name not in HEADINGS:
        return float(np.sort(values)[(len(values) - 1) // 2])
    mean = np.arctan2(np.sin(values).mean(), np.cos(values).mean())
    return float(values[np.argmin(np.abs(wrap_angle(values - mean)))])
