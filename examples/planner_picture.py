# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The picture of a planned sequence of pushes: start, predicted and observed pose of each push, and the goal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.geometry.outline import Outline
from push_predictor.planning.choose import Choice
from push_predictor.planning.goal import Goal
from push_predictor.reporting.canvas import NEARBY, OBSERVED, PREDICTED, draw, outside_legend
from push_predictor.reporting.slider_picture import paint_goal, paint_outline, paint_push
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = 2


@dataclass(frozen=True, eq=False)
class Step:
    """One push: slider before and after (3,), the choice, travel of the tip (m), samples of rollout_pushes (p, 3)."""

    before: Array
    choice: Choice
    travel: float
    samples: Array
    after: Array


def draw_pushes(path: Path, steps: Sequence[Step], goal: Goal, outline: Outline) -> Path:
    """Draw a panel for each push. Raises PushPredictorError if matplotlib is not installed."""
    columns = min(COLUMNS, max(len(steps), 1))
    rows = -(-len(steps) // columns) or 1

    def paint(figure: Figure) -> None:
        panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
        for count, (axes, step) in enumerate(zip(panels, steps, strict=False), 1):
            _paint(axes, step, goal, outline)
            axes.set_title(f"Push {count}: probability of reaching the goal {step.choice.probability:.2f}", loc="left")
        for axes in panels[len(steps) :]:
            axes.set_axis_off()
        handles, labels = panels[0].get_legend_handles_labels()
        outside_legend(figure, handles, labels, side="below", ncols=len(labels), markerscale=4.0)

    return draw(path, (3.6 * columns, 3.0 * rows + 0.5), paint)


def _paint(axes: Axes, step: Step, goal: Goal, outline: Outline) -> None:
    paint_goal(axes, outline, goal.pose, goal.distance)
    paint_outline(axes, outline, step.before, color=NEARBY, linewidth=0.9, label="before")
    axes.plot(
        *(1e3 * step.samples[:, :2].T),
        ".",
        color=PREDICTED,
        markersize=1.5,
        alpha=0.4,
        label="predicted centre (rollout_pushes)",
    )
    paint_outline(axes, outline, step.after, color=OBSERVED, label="after")
    axes.plot(*(1e3 * step.after[:2]), "o", color=OBSERVED, markersize=3.0)
    paint_push(axes, outline, step.before, step.choice.push.inputs[0], step.travel)
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
    axes.label_outer()
