# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Predicted 95 % ellipses with observed outcomes, for a few pushes at different contacts and angles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.evaluation.report.figures.nearby import Example
from push_predictor.evaluation.report.figures.slider import magnification, paint_slider
from push_predictor.evaluation.validation import Comparison
from push_predictor.models.predictors.tails import Tails, half_widths, joint_radius
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.canvas import (
    NEARBY,
    OBSERVED,
    PREDICTED,
    SYMBOLS,
    UNIT_NAMES,
    UNITS,
    grid,
    output_label,
    outside_legend,
)
from push_predictor.types import Array, BoolArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

LEVEL = 0.95
ACROSS = 2  # examples side by side
DOTS: dict[str, Any] = {"color": NEARBY, "markersize": 3, "alpha": 0.7, "mew": 0.0}
DIAMOND: dict[str, Any] = {"color": OBSERVED, "markersize": 5}


def paint_examples(
    figure: Figure, rig: Rig, table: PushTable, comparison: Comparison, shown: Sequence[Example]
) -> None:
    """One block per example: the slider, the ellipse of (dx, dy) and the interval of dtheta."""
    rows = -(-len(shown) // ACROSS)
    parts = figure.subfigures(rows, ACROSS, squeeze=False, hspace=0.03, wspace=0.03)
    for number, (part, example) in enumerate(zip(parts.ravel(), shown, strict=False)):
        middle: Axes = _paint_example(part, rig, table, comparison, example)
        if number == 0:
            outside_legend(figure, *middle.get_legend_handles_labels(), side="below", ncols=3)


def paint_ellipse(
    ax: Axes, mean: Array, covariance: Array, tails: Tails | None, label: str | None = None, colour: str = PREDICTED
) -> None:
    """The 95 % ellipse of (dx, dy) in mm: mean (3,), covariance (3, 3) in m and rad."""
    outline = mean[:2] + ellipse(covariance[:2, :2], tails)
    ax.fill(*(outline.T * UNITS[0]), facecolor=colour, alpha=0.15, linewidth=0.0)
    ax.plot(*(outline.T * UNITS[0]), color=colour, linewidth=1.2, label=label)
    ax.plot(*(mean[:2] * UNITS[0]), "+", color=colour, markersize=7, markeredgewidth=1.4)


def ellipse(covariance: Array, tails: Tails | None, level: float = LEVEL, count: int = 121) -> Array:
    """Boundary (count, 2) of the ellipse at zero that contains `level` of a prediction with covariance (2, 2)."""
    turn = np.linspace(0.0, 2.0 * np.pi, count)
    circle = joint_radius(tails, level, 2) * np.stack([np.cos(turn), np.sin(turn)])
    return np.asarray((np.linalg.cholesky(covariance) @ circle).T)


def inside(mean: Array, covariance: Array, outcomes: Array, tails: Tails | None, level: float = LEVEL) -> BoolArray:
    """Which (dx, dy) of the outcomes (n, 3) lie in the ellipse."""
    away = (outcomes - mean)[:, :2]
    squared = np.sum(away * np.linalg.solve(covariance[:2, :2], away.T).T, axis=1)
    return np.asarray(squared <= joint_radius(tails, level, 2) ** 2)


def _paint_example(part: SubFigure, rig: Rig, table: PushTable, comparison: Comparison, example: Example) -> Axes:
    """Paint one block and return the axes with the ellipse."""
    row = example.row
    enlarged = magnification(rig.outline, np.stack([comparison.mean[row], comparison.observed[row]]))
    left: Axes
    middle: Axes
    right: Axes
    left, middle, right = part.subplots(1, 3, width_ratios=(1.0, 1.25, 0.42))
    velocity, _, angle = table.inputs[row]
    title = f"{velocity * 1e3:.0f} mm/s, push angle {np.degrees(angle):.0f}°, {table.duration[row]:.2g} s"
    part.suptitle(title.replace("-", "−"), fontsize=9.0)
    paint_slider(left, rig, table.inputs[row], comparison.mean[row], comparison.observed[row], enlarged)
    left.set_title(f"motion ×{enlarged:g}", fontsize=8.0)
    _paint_plane(middle, comparison, example)
    _paint_rotation(right, comparison, example)
    return middle


def _paint_plane(ax: Axes, comparison: Comparison, example: Example) -> None:
    mean, covariance = comparison.mean[example.row], comparison.covariance[example.row]
    grid(ax)
    paint_ellipse(ax, mean, covariance, comparison.tails, label="predicted, 95 %")
    ax.plot(*(example.nearby[:, :2].T * UNITS[0]), "o", label="windows with similar inputs", **DOTS)
    ax.plot(*(comparison.observed[example.row, :2] * UNITS[0]), "D", label="this window", **DIAMOND)
    count = int(inside(mean, covariance, example.nearby, comparison.tails).sum())
    pushes = f"{example.pushes} push{'' if example.pushes == 1 else 'es'}"
    ax.set_title(f"similar: {count} of {len(example.nearby)} inside ({pushes})", fontsize=8.0)
    ax.set_xlabel(output_label(0))
    ax.set_ylabel(output_label(1))
    ax.set_aspect("equal", adjustable="datalim")
    ax.locator_params(nbins=5)


def _paint_rotation(ax: Axes, comparison: Comparison, example: Example) -> None:
    mean, sd = comparison.mean[example.row, 2], np.sqrt(comparison.covariance[example.row, 2, 2])
    half = half_widths(comparison.tails, LEVEL)[2] * sd
    grid(ax)
    ax.axhspan(*(np.array([mean - half, mean + half]) * UNITS[2]), color=PREDICTED, alpha=0.15, linewidth=0.0)
    for height in (mean - half, mean + half):
        ax.axhline(height * UNITS[2], color=PREDICTED, linewidth=1.2)
    spread = np.linspace(-0.3, 0.3, len(example.nearby)) if len(example.nearby) > 1 else np.zeros(len(example.nearby))
    ax.plot(spread, example.nearby[:, 2] * UNITS[2], "o", **DOTS)
    ax.plot(0.0, comparison.observed[example.row, 2] * UNITS[2], "D", **DIAMOND)
    ax.set_xlim(-0.6, 0.6)
    ax.set_xticks([])
    ax.set_title(f"{SYMBOLS[2]} ({UNIT_NAMES[2]})", fontsize=8.0)
    ax.margins(y=0.15)
