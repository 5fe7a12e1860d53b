"""Histograms of single pushes with the densities that a model gives them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.figures.canvas import COLOURS, NEARBY, UNIT_NAMES, UNITS, output_label
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS = 200
BESIDE = 0.75  # of the range of the outcomes, to both sides of it


@dataclass(frozen=True, eq=False)
class Histogram:
    """One output of one push: outcomes (r,) of its repetitions; log densities (v,) of a model at values (v,); SI."""

    title: str
    output: int
    outcomes: Array
    values: Array
    gaussian: Array
    exact: Array


def paint_histograms(figure: Figure, rows: Sequence[Sequence[Histogram]]) -> None:
    """A panel each; histograms of unit area."""
    panels = figure.subplots(len(rows), len(rows[0]), squeeze=False)
    for axes, histograms in zip(panels, rows, strict=True):
        for ax, histogram in zip(axes, histograms, strict=True):
            _paint(ax, histogram)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)


def shown_values(outcomes: Array) -> Array:
    """Where densities are drawn: POINTS values (v, 3) over the outcomes (r, 3) and beside them."""
    low, high = outcomes.min(axis=0), outcomes.max(axis=0)
    return np.linspace(low - BESIDE * (high - low), high + BESIDE * (high - low), POINTS)


def _paint(ax: Axes, histogram: Histogram) -> None:
    unit = UNITS[histogram.output]
    bins = int(np.clip(1.6 * np.sqrt(len(histogram.outcomes)), 8, 24))
    ax.hist(histogram.outcomes * unit, bins, density=True, color=NEARBY, alpha=0.4, label="repetitions")
    curves = (
        (histogram.gaussian, "-", COLOURS[0], "VHGP, Gaussian"),
        (histogram.exact, "--", COLOURS[1], "VHGP, exact"),
    )
    for logs, line, colour, label in curves:
        ax.plot(histogram.values * unit, np.exp(logs) / unit, line, color=colour, linewidth=1.5, label=label)
    ax.set_xlim(histogram.values[0] * unit, histogram.values[-1] * unit)
    ax.set_title(histogram.title)
    ax.set_xlabel(output_label(histogram.output))
    ax.set_ylabel(f"density (1/{UNIT_NAMES[histogram.output]})")
