# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Maps over contact and angle of the pushes of one side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.report.maps import ColourScale
from push_predictor.reporting.canvas import EMPTY, OBSERVED
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Map:
    """Values (A, C) in shown units over angles (A,) rad and contacts (C,), NaN where unknown; label: of the colours.

    logarithmic: the colours; marked: a push (contact, angle) with a circle around it.
    """

    title: str
    fractions: Array
    angles: Array
    values: Array
    scale: ColourScale
    label: str
    logarithmic: bool = False
    marked: tuple[float, float] | None = None


def paint_maps(
    figure: Figure,
    rows: Sequence[tuple[str, Sequence[Map]]],
    below_first: Callable[[Axes, int], None] | None = None,
) -> None:
    """Maps by row, each row with its name. below_first: paints a panel below each map of the first row."""
    extra = int(below_first is not None)
    heights = [1.0, *([0.62] * extra), *([1.0] * (len(rows) - 1))]
    axes = figure.subplots(len(rows) + extra, len(rows[0][1]), squeeze=False, height_ratios=heights)
    if below_first is not None:
        for k, ax in enumerate(axes[1]):
            below_first(ax, k)
    places = [place for place in range(len(axes)) if not (extra and place == 1)]
    for place, (name, maps) in zip(places, rows, strict=True):
        for ax, shown in zip(axes[place], maps, strict=True):
            _paint(figure, ax, shown)
            ax.tick_params(labelbottom=place == places[-1], labelleft=ax is axes[place][0])
        axes[place][0].set_ylabel(f"{name}\npush angle (deg)".lstrip())
    for ax in axes[-1]:
        ax.set_xlabel("contact, fraction of the side")


def _paint(figure: Figure, ax: Axes, shown: Map) -> None:
    """Draw one map; unknown pushes are grey and hatched."""
    from matplotlib.colors import LogNorm, Normalize

    ax.set_facecolor(EMPTY)
    ax.patch.set_hatch("////")
    edges = (_edges(shown.fractions), np.degrees(_edges(shown.angles)))
    norm = (LogNorm if shown.logarithmic else Normalize)(shown.scale.low, shown.scale.high)
    image = ax.pcolormesh(*edges, shown.values, cmap=shown.scale.name, norm=norm, rasterized=True)
    bar = figure.colorbar(image, ax=ax, extend=shown.scale.extend, label=shown.label)
    if not shown.logarithmic:
        bar.ax.locator_params(nbins=5)
    ax.set(xlim=(edges[0][0], edges[0][-1]), ylim=(edges[1][0], edges[1][-1]), yticks=(-60, 0, 60), title=shown.title)
    ax.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0], ["0", "0.25", "0.5", "0.75", "1"])
    for side in ("top", "right"):
        ax.spines[side].set_visible(True)
    if shown.marked is not None:
        place = (shown.marked[0], np.degrees(shown.marked[1]))
        for colour, width in (("white", 3.0), (OBSERVED, 1.5)):
            ax.plot(*place, "o", markersize=9, markerfacecolor="none", markeredgecolor=colour, markeredgewidth=width)


def _edges(centres: Array) -> Array:
    middle = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate([[2 * centres[0] - middle[0]], middle, [2 * centres[-1] - middle[-1]]])
