# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Maps of the noise on several surfaces, and the size of the noise relative to the motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.evaluation.report.maps import ColourScale
from push_predictor.reporting.canvas import COLOURS, SYMBOLS, grid, outside_legend
from push_predictor.types import Array
from push_predictor_paper.data.repetitions import RepeatedGrid
from push_predictor_paper.figures.repetition_maps import paint_map
from push_predictor_paper.statistics.noise_figures import HIGH, LOW

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINES = ("-", "--", "-.", ":")
TICKS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
MARKS = ("o", "s", "^")


def paint_noise_maps(figure: Figure, grids: Mapping[str, RepeatedGrid]) -> None:
    """Draw a row per surface, a column per output: sd over the surface's median, one scale per column."""
    axes = figure.subplots(len(grids) + 1, 3, height_ratios=[1.0] * len(grids) + [0.07])
    maps = [g.sd / np.nanmedian(g.sd, axis=(0, 1)) for g in grids.values()]
    for k, column in enumerate(axes.T):
        top = float(np.nanpercentile([m[..., k] for m in maps], 99.0))
        scale = ColourScale(0.0, top, "viridis", "max")
        for ax, g, m in zip(column[:-1], grids.values(), maps, strict=True):
            image = paint_map(ax, g.fractions, g.angles, m[..., k], scale)
            ax.tick_params(labelbottom=ax is column[-2], labelleft=k == 0)
        column[0].set_title(f"sd of {SYMBOLS[k]}")
        column[-2].set_xlabel("contact, fraction of the side")
        figure.colorbar(
            image, cax=column[-1], label="sd / median of the surface", extend="max", orientation="horizontal"
        )
    for row, surface in zip(axes[:-1], grids, strict=True):
        row[0].set_ylabel(f"{surface}\npush angle (deg)")


def paint_scatter(figure: Figure, reference: RepeatedGrid, others: Mapping[str, RepeatedGrid]) -> None:
    """Draw a panel per output: sd of every push over its surface's median, reference surface against others."""
    axes = figure.subplots(1, 3)
    for k, ax in enumerate(axes):
        grid(ax)
        one = _standardised(reference, k)
        for number, (surface, other) in enumerate(others.items()):
            look: dict[str, Any] = {"color": COLOURS[number % 3], "markersize": 3.0, "alpha": 0.55, "mew": 0.0}
            ax.plot(one, _standardised(other, k), MARKS[number % 3], label=surface, **look)
        every = np.concatenate([one, *(_standardised(other, k) for other in others.values())])
        ends = (np.nanmin(every) / 1.1, np.nanmax(every) * 1.1)
        ax.plot(ends, ends, color="0.2", linewidth=0.9)
        ax.set(xscale="log", yscale="log", title=f"sd of {SYMBOLS[k]}", xlabel=f"{reference.surface} (sd / median)")
        ticks = [tick for tick in TICKS if ends[0] <= tick <= ends[1]]
        ax.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        ax.minorticks_off()
        ax.set(xlim=ends, ylim=ends, aspect="equal")
    axes[0].set_ylabel("other surface (sd / median)")
    handles, labels = axes[0].get_legend_handles_labels()
    outside_legend(figure, handles, labels, side="above", ncols=len(labels), markerscale=2.0)


def paint_ratios(figure: Figure, ratios: Sequence[tuple[str, Array]]) -> None:
    """Draw the cumulative share of pushes by sd over |mean|, with the paper's 10 to 40 % shaded."""
    ax = figure.subplots()
    grid(ax)
    ax.axvspan(100 * LOW, 100 * HIGH, color="0.9", label="the paper's 10 to 40 %")
    for number, (name, values) in enumerate(ratios):
        ordered = np.sort(100.0 * values)
        share = np.arange(1, len(ordered) + 1) / len(ordered)
        colour = COLOURS[number] if number < len(COLOURS) else "black"
        ax.step(ordered, 100.0 * share, where="post", color=colour, linestyle=LINES[number % 4], label=name)
    ax.set(xscale="log", xlim=(1.0, 1000.0), ylim=(0.0, 100.0), xlabel="sd of the outcome, % of its |mean|")
    ax.set_xticks([1, 3, 10, 30, 100, 300, 1000], ["1", "3", "10", "30", "100", "300", "1000"])
    ax.minorticks_off()
    ax.set_ylabel("cumulative share of pushes (%)")
    outside_legend(figure, *ax.get_legend_handles_labels(), side="right")


def _standardised(shown: RepeatedGrid, k: int) -> Array:
    """Sds (C * A,) of output k, pushes in the order of the grid's cells."""
    sd = np.array([cell.sd[k] for cell in shown.cells])
    return np.asarray(sd / np.nanmedian(sd))
