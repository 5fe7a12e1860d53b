"""Mean standardised residual over contact point and push angle, before and after, on one colour scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.report.figures.push_maps import ColourScale, contact_label, paint_panel
from push_predictor.evaluation.report.maps import Cells, PushMap, coarse_cells, recorded_map
from push_predictor.geometry.outline import Outline
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.canvas import SYMBOLS
from push_predictor.residuals.reporting.figures.partial import Strength
from push_predictor.residuals.reporting.phrases import covariate_phrase
from push_predictor.types import Array, BoolArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEAST_REACH = 1.0  # predicted standard deviations at either end of the colours; less is noise of few windows
WIDEST = 97.0  # % of the cells whose values the colours resolve


@dataclass(frozen=True, eq=False)
class Column:
    """A column of the picture: standardised residuals z (n, 3) of the windows of a table."""

    title: str
    table: PushTable
    z: Array


@dataclass(frozen=True, eq=False)
class Halves:
    """Windows (n,) split by the strength of an effect, with the names of both parts; one part if it is constant."""

    masks: tuple[BoolArray, ...]
    names: tuple[str, ...]


def halves_of(strength: Strength | None, table: PushTable) -> Halves:
    """Windows below and above the median of the fitted effect: its sign differs between them."""
    if strength is None or not strength.effect.basis.drivers:
        return Halves((np.ones(len(table), dtype=np.bool_),), ("",))
    values = strength.curve(table.covariates, len(table))[0]
    widest = values[:, int(np.argmax(values.std(axis=0)))]
    above = widest > np.median(widest)
    return Halves((~above, above), _names(strength.effect.basis, above, table))


def columns_of(title: str, table: PushTable, z: Array, halves: Halves) -> list[Column]:
    """A column for each half."""
    return [
        Column(title if not name else f"{title}\n{name}", table.take(mask), z[mask])
        for mask, name in zip(halves.masks, halves.names, strict=True)
        if mask.any()
    ]


def paint_residual_maps(figure: Figure, outline: Outline, columns: Sequence[Column]) -> None:
    """Paint rows dx, dy, dtheta, a column for each of `columns`; numbers are pushes."""
    maps = [residual_map(outline, column, _cells(outline, columns)) for column in columns]
    scale = scale_of(maps)
    axes = figure.subplots(len(SYMBOLS), len(columns), sharex=True, sharey=True, squeeze=False)
    for k, row in enumerate(axes):
        for ax, shown in zip(row, maps, strict=True):
            image = paint_panel(ax, outline, shown, shown.mean[..., k], scale, counted=len(columns) < 3)
        row[0].set_ylabel(f"{SYMBOLS[k]}\nPush angle (deg)")
    for ax, column in zip(axes[0], columns, strict=True):
        ax.set_title(column.title)
    label = "Mean residual / predicted standard deviation"
    figure.colorbar(image, ax=axes.ravel().tolist(), label=label, extend=scale.extend, pad=0.01, aspect=36, shrink=0.8)
    figure.supxlabel(contact_label(outline), fontsize=9.0)


def residual_map(outline: Outline, column: Column, cells: Cells) -> PushMap:
    """Mean residual per cell."""
    shown = replace(column.table, outcomes=column.z)
    return recorded_map(outline, shown, np.zeros_like(column.z), cells)


def scale_of(maps: Sequence[PushMap]) -> ColourScale:
    """One scale for all, symmetric about zero."""
    known = np.abs(np.concatenate([m.mean[np.isfinite(m.mean)] for m in maps]))
    reach = max(LEAST_REACH, float(np.percentile(known, WIDEST))) if known.size else LEAST_REACH
    cut = bool(known.size and known.max() > reach)
    return ColourScale(-reach, reach, "PuOr_r", "both" if cut else "neither")


def _cells(outline: Outline, columns: Sequence[Column]) -> Cells:
    """Cells for the column with the fewest windows, over the angles of all."""
    fewest = min((column.table for column in columns), key=len)
    widest = max((column.table for column in columns), key=len)
    cells, angle = coarse_cells(outline, fewest), coarse_cells(outline, widest).angle
    return Cells(cells.contact, np.linspace(angle[0], angle[-1], len(cells.angle)))


def _names(basis: DriverBasis, above: BoolArray, table: PushTable) -> tuple[str, str]:
    phrase, values = covariate_phrase(basis.drivers[0]), table.covariates[basis.drivers[0]]
    low, high = values[~above], values[above]
    if len(basis.drivers) == 1 and high.size and low.size and (low.max() <= high.min() or high.max() <= low.min()):
        lower, upper = f"{phrase}: low", f"{phrase}: high"
        return (lower, upper) if low.max() <= high.min() else (upper, lower)
    return f"effect of {phrase}: low", f"effect of {phrase}: high"
