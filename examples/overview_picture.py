# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The overview figure of the demo: predicted sd, recorded sd, and ellipses with outcomes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.report.figures.ellipses import Example, examples, inside, paint_ellipse
from push_predictor.evaluation.report.maps import (
    coarse_cells,
    colour_scale,
    commonest_condition,
    fine_cells,
    fixed_covariates,
    paint_panel,
    push_map,
    recorded_map,
)
from push_predictor.evaluation.validation import Comparison, compare
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.canvas import UNITS, draw, grid, output_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE = (11.0, 3.4)
SHOWN_OUTPUT = 2  # dtheta: its noise depends most on the push
EXAMPLES = 5
EXAMPLE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#8a6d00")


def readme_picture(out_png: Path, model: PushModel, table: PushTable) -> Path:
    """Draw predicted and recorded sd of dtheta and 95 % ellipses at the most common speed; return out_png.

    Raises PushPredictorError if matplotlib is not installed, TableError for a table without rows.
    """
    condition = commonest_condition(table)
    similar = table.take(condition.rows)
    return draw(out_png, SIZE, lambda figure: _paint(figure, model, similar, condition.velocity, condition.duration))


def _paint(figure: Figure, model: PushModel, table: PushTable, velocity: float, duration: float) -> None:
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.2))
    outline = model.rig.outline
    held = fixed_covariates(model, table)
    predicted = push_map(model, velocity, duration, fine_cells(outline, table), held)
    comparison = compare(model, table)
    recorded = recorded_map(outline, table, comparison.mean, coarse_cells(outline, table))
    values = [shown.sd[..., SHOWN_OUTPUT] * UNITS[SHOWN_OUTPUT] for shown in (predicted, recorded)]
    scale = colour_scale(values)
    columns = zip((left, middle), (predicted, recorded), values, ("predicted", "recorded"), strict=True)
    for ax, shown, value, title in columns:
        image = paint_panel(ax, outline, shown, value, scale, counted=False)
        ax.set_title(f"{title} sd at {velocity * 1e3:.0f} mm/s")
        ax.set_xlabel("contact along the outline (mm)")
    if held:
        at = ", ".join(f"{name} {value:.3g}" for name, value in held.items())
        left.set_xlabel(f"contact along the outline (mm)\nat {at}")
    left.set_ylabel("push angle (deg)")
    label = f"sd of {output_label(SHOWN_OUTPUT)}"
    figure.colorbar(image, ax=[left, middle], label=label, extend=scale.extend, pad=0.01)
    _paint_outcomes(right, comparison, examples(outline, table, comparison, EXAMPLES))


def _paint_outcomes(ax: Axes, comparison: Comparison, shown: Sequence[Example]) -> None:
    grid(ax)
    hits = total = 0
    for colour, example in zip(EXAMPLE_COLOURS, shown, strict=False):
        mean, covariance = comparison.mean[example.row], comparison.covariance[example.row]
        outcomes = np.vstack([example.nearby, comparison.observed[example.row]])
        paint_ellipse(ax, mean, covariance, comparison.tails, colour=colour)
        ax.plot(*(outcomes[:, :2].T * UNITS[0]), "o", color=colour, markersize=3.2, mew=0.4, mec="white")
        hits, total = hits + int(inside(mean, covariance, outcomes, comparison.tails).sum()), total + len(outcomes)
    ax.set_title(f"95 % ellipses: {hits} of {total} outcomes inside")
    ax.set_xlabel(output_label(0))
    ax.set_ylabel(output_label(1))
    ax.margins(0.08)
    ax.set_aspect("equal", adjustable="datalim")
