# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Colour maps of mean or standard deviation by contact and angle, predicted next to recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.report.maps import PushMap, fold_order, sector_length
from push_predictor.geometry.outline import Outline
from push_predictor.reporting.canvas import EMPTY, UNITS, output_label
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

CLIPPED = 3.0  # % of a panel's values that may exceed the colour scale at each end
ONE_SIGNED = 0.1  # largest share of the other sign in a scale of one sign


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
