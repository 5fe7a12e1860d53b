# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Histograms of single pushes with a model's densities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.reporting.canvas import COLOURS, NEARBY, UNIT_NAMES, UNITS, output_label, outside_legend
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS = 200
MARGIN = 0.75  # of the range of the outcomes, to both sides of it
WIDTHS = 2.0  # predicted sds shown to both sides of the mean, so that a model that is too wide is visible


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
    """Draw a panel for each histogram, with unit area."""
    panels = figure.subplots(len(rows), len(rows[0]), squeeze=False)
    for axes, histograms in zip(panels, rows, strict=True):
        for ax, histogram in zip(axes, histograms, strict=True):
            _paint(ax, histogram)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    outside_legend(figure, handles, labels, side="above", ncols=3)


def shown_values(outcomes: Array) -> Array:
    """POINTS values (v, 3) at which densities are drawn, over the outcomes (r, 3) and a margin."""
    low, high = outcomes.min(axis=0), outcomes.max(axis=0)
    return np.linspace(low - MARGIN * (high - low), high + MARGIN * (high - low), POINTS)


def moments(values: Array, logs: Array) -> tuple[float, float]:
    """Mean and sd of the Gaussian whose log densities at values (v,) are logs (v,)."""
    middle, half = 0.5 * (values[0] + values[-1]), 0.5 * (values[-1] - values[0])
    square, slope, _ = np.polyfit((values - middle) / half, logs, 2)
    return float(middle - 0.5 * half * slope / square), float(half * np.sqrt(-0.5 / square))


def _paint(ax: Axes, histogram: Histogram) -> None:
    unit = UNITS[histogram.output]
    bins = int(np.clip(1.6 * np.sqrt(len(histogram.outcomes)), 8, 24))
    ax.hist(histogram.outcomes * unit, bins, density=True, color=NEARBY, alpha=0.4, label="repetitions")
    mean, sd = moments(histogram.values, histogram.gaussian)
    ends = np.array([mean - WIDTHS * sd, mean + WIDTHS * sd])
    low, high = min(ends[0], histogram.values[0]), max(ends[1], histogram.values[-1])
    wide = np.linspace(low, high, POINTS)
    gaussian = np.exp(-0.5 * ((wide - mean) / sd) ** 2) / (np.sqrt(2.0 * np.pi) * sd)
    exact = np.exp(histogram.exact)
    for x, y, line, colour, label in (
        (wide, gaussian, "-", COLOURS[0], "VHGP, Gaussian"),
        (histogram.values, exact, "--", COLOURS[1], "VHGP, exact"),
    ):
        ax.plot(x * unit, y / unit, line, color=colour, linewidth=1.5, label=label)
    ax.set_xlim(low * unit, high * unit)
    ax.locator_params(axis="x", nbins=6)
    ax.set_title(histogram.title)
    ax.set_xlabel(output_label(histogram.output))
    ax.set_ylabel(f"density (1/{UNIT_NAMES[histogram.output]})")
