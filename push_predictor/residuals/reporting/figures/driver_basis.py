"""An effect as fitted against its covariate, with its band, and the data that it rests on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.canvas import OBSERVED, PREDICTED, grid
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.partial import Binned, Rows, Strength, binned, per_push, responses
from push_predictor.residuals.reporting.phrases import capitalised, covariate_phrase, label, with_unit
from push_predictor.types import Array, IntArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GRID = 400
PUSHES_PER_BIN = 12
FEWEST_BINS, MOST_BINS = 3, 12
MAP_BINS = 5
HELD_OUT = "#3b3b3b"
ASIDE = 0.08  # offset of the points of a category's levels, to either side
PERIODIC = ("periodic", "periodic, twice around")


def paint_basis(figure: Figure, trace: Trace, strength: Strength, analysis: Rows, held_out: Rows | None) -> None:
    """Paint a panel for each parameter; for a map two: fitted, and estimated cell by cell."""
    if len(strength.effect.basis.drivers) > 1:
        _paint_maps(figure, trace, strength, analysis)
        return
    axes = figure.subplots(1, len(strength.names), squeeze=False)[0]
    for q, ax in enumerate(axes):
        _paint_panel(ax, trace, strength, analysis, held_out, q)
    axes[0].legend(loc="best")


def bins_of(basis: DriverBasis, table: PushTable) -> IntArray:
    """Bin (n,) of each window: levels of a category, equal widths of a heading, else equal counts."""
    values = table.covariates[basis.drivers[0]]
    if basis.name == "category":
        return np.asarray(np.searchsorted(np.sort(basis.levels), values), dtype=np.int64)
    count = int(np.clip(len(table.pushes) // PUSHES_PER_BIN, FEWEST_BINS, MOST_BINS))
    if basis.name in PERIODIC:
        return np.asarray(np.clip((values + np.pi) / (2.0 * np.pi) * count, 0, count - 1), dtype=np.int64)
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, count + 1)[1:-1]))
    return np.asarray(np.searchsorted(edges, values, side="right"), dtype=np.int64)


def hidden_pushes(strength: Strength, trace: Trace, rows: Rows) -> str:
    """How many pushes have no dot inside each panel, in words."""
    place, value = per_push(strength, rows, responses(trace, strength, rows), _axis(strength.effect.basis, rows.table))
    limits = [_limits(strength, trace, rows, q) for q in range(value.shape[1])]
    inside = [np.sum((value[:, q] >= low) & (value[:, q] <= high)) for q, (low, high) in enumerate(limits)]
    return ", ".join(f"{len(place) - int(n)} of {len(place)}" for n in inside)


def driver_label(basis: DriverBasis) -> str:
    """The covariate with its unit."""
    name = basis.drivers[0]
    return f"{label(covariate_phrase(name))} (deg)" if basis.name in PERIODIC else with_unit(name)


def _paint_panel(ax: Axes, trace: Trace, strength: Strength, analysis: Rows, held_out: Rows | None, q: int) -> None:
    basis = strength.effect.basis
    grid(ax)
    ax.axhline(0.0, color="0.2", linewidth=0.8, linestyle=":")
    _paint_curve(ax, strength, analysis.table, q)
    aside = ASIDE if basis.name == "category" else 0.0
    response = responses(trace, strength, analysis)
    place, value = per_push(strength, analysis, response, _axis(basis, analysis.table))
    ax.plot(place, value[:, q], "o", color="0.55", markersize=2.4, mew=0.0, alpha=0.6, label="one push", zorder=1)
    _paint_bins(ax, _bins(trace, strength, analysis), q, OBSERVED, "o", "analysis pushes, binned", -aside)
    if held_out is not None:
        _paint_bins(ax, _bins(trace, strength, held_out), q, HELD_OUT, "s", "held-out pushes, binned", aside)
    ax.set_ylim(_limits(strength, trace, analysis, q))
    unit = strength.units[q]
    ax.set_xlabel(driver_label(basis))
    ax.set_ylabel(capitalised(strength.names[q]) if unit == "1" else f"{capitalised(strength.names[q])} ({unit})")
    if basis.name == "category":
        ax.set_xticks(basis.levels)


def _paint_curve(ax: Axes, strength: Strength, table: PushTable, q: int) -> None:
    basis = strength.effect.basis
    values = table.covariates[basis.drivers[0]]
    if basis.name == "category":
        points = np.array(basis.levels)
        mean, half = strength.curve({basis.drivers[0]: points}, len(points))
        bars: dict[str, Any] = {"fmt": "_", "color": PREDICTED, "markersize": 22.0, "elinewidth": 8.0, "alpha": 0.45}
        ax.errorbar(points, mean[:, q], half[:, q], label="fitted, 95 %", **bars)
        return
    low, high = (-np.pi, np.pi) if basis.name in PERIODIC else (float(values.min()), float(values.max()))
    points = np.linspace(low, high, GRID)
    mean, half = strength.curve({basis.drivers[0]: points}, GRID)
    x = np.degrees(points) if basis.name in PERIODIC else points
    ax.fill_between(x, mean[:, q] - half[:, q], mean[:, q] + half[:, q], color=PREDICTED, alpha=0.22, linewidth=0.0)
    ax.plot(x, mean[:, q], color=PREDICTED, linewidth=1.8, label=f"fitted ({basis.name}), 95 % band")


def _paint_bins(ax: Axes, bins: Binned, q: int, colour: str, marker: str, label: str, aside: float) -> None:
    ends = np.abs(np.stack([bins.value[:, q] - bins.low[:, q], bins.high[:, q] - bins.value[:, q]]))
    look: dict[str, Any] = {"fmt": marker, "color": colour, "markersize": 5.0, "elinewidth": 1.2, "capsize": 2.0}
    if marker == "s":
        look["mfc"] = "white"
    ax.errorbar(bins.place + aside, bins.value[:, q], ends, label=label, zorder=3, **look)


def _bins(trace: Trace, strength: Strength, rows: Rows) -> Binned:
    basis = strength.effect.basis
    response = responses(trace, strength, rows)
    return binned(strength, rows, response, _axis(basis, rows.table), bins_of(basis, rows.table))


def _axis(basis: DriverBasis, table: PushTable) -> Array:
    values = table.covariates[basis.drivers[0]]
    return np.degrees(values) if basis.name in PERIODIC else values


def _limits(strength: Strength, trace: Trace, rows: Rows, q: int) -> tuple[float, float]:
    """Limits that contain the curve and the bins; single pushes may lie outside."""
    mean, half = strength.curve(rows.table.covariates, len(rows.table))
    bins = _bins(trace, strength, rows)
    low = min((mean - half)[:, q].min(), bins.low[:, q].min(initial=0.0), 0.0)
    high = max((mean + half)[:, q].max(), bins.high[:, q].max(initial=0.0), 0.0)
    margin = 0.35 * max(high - low, 1e-12)
    return float(low - margin), float(high + margin)


def _paint_maps(figure: Figure, trace: Trace, strength: Strength, rows: Rows) -> None:
    """Paint a row for each parameter: the fitted map with the windows, and each cell estimated by itself."""
    first, second = strength.effect.basis.drivers
    x, y = rows.table.covariates[first], rows.table.covariates[second]
    edges = [np.linspace(v.min(), v.max(), MAP_BINS + 1) for v in (x, y)]
    column, line = (_in_bin(e, v) for e, v in zip(edges, (x, y), strict=True))
    found = binned(strength, rows, responses(trace, strength, rows), (line * MAP_BINS + column).astype(float),
                   line * MAP_BINS + column)  # fmt: skip
    axes = figure.subplots(len(strength.names), 2, squeeze=False, sharex=True, sharey=True)
    for q, (left, right) in enumerate(axes):
        fine = [np.linspace(e[0], e[-1], 40) for e in edges]
        gx, gy = np.meshgrid(*fine)
        fitted = strength.curve({first: gx.ravel(), second: gy.ravel()}, gx.size)[0][:, q].reshape(gx.shape)
        cells = np.full(MAP_BINS * MAP_BINS, np.nan)
        cells[np.round(found.place).astype(np.int64)] = found.value[:, q]
        reach = max(float(np.abs(fitted).max()), 1e-12)
        look: dict[str, Any] = {"cmap": "PuOr_r", "vmin": -reach, "vmax": reach}
        left.pcolormesh(*fine, fitted, shading="nearest", rasterized=True, **look)
        left.plot(x, y, ".", color="0.2", markersize=1.5, mew=0.0)
        image = right.pcolormesh(*edges, cells.reshape(MAP_BINS, MAP_BINS), edgecolors="white", linewidth=0.5, **look)
        unit = strength.units[q]
        label = strength.names[q] if unit == "1" else f"{strength.names[q]} ({unit})"
        figure.colorbar(image, ax=[left, right], label=label, extend="both", pad=0.01, shrink=0.9)
        left.set_ylabel(with_unit(second))
    axes[0, 0].set_title("fitted (dots: windows)")
    axes[0, 1].set_title("estimated cell by cell")
    for ax in axes[-1]:
        ax.set_xlabel(with_unit(first))


def _in_bin(edges: Array, values: Array) -> IntArray:
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2).astype(np.int64)
