# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The picture of a planned sequence of pushes: start, predicted and observed pose of each push, and the goal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.geometry.frames import rotate, to_world
from push_predictor.geometry.outline import Outline
from push_predictor.planning.choose import Choice
from push_predictor.planning.goal import Goal
from push_predictor.reporting.canvas import NEARBY, OBSERVED, PREDICTED, draw, outside_legend
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GOAL_COLOUR = "#009E73"
COLUMNS = 2
ARROW = 0.012  # m, at least


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
    _paint_outline(axes, outline, goal.pose, color=GOAL_COLOUR, linestyle="--", label="goal")
    _paint_outline(axes, outline, step.before, color=NEARBY, linewidth=0.9, label="before")
    axes.plot(
        *(1e3 * step.samples[:, :2].T),
        ".",
        color=PREDICTED,
        markersize=1.5,
        alpha=0.4,
        label="predicted centre (rollout_pushes)",
    )
    _paint_outline(axes, outline, step.after, color=OBSERVED, label="after")
    axes.plot(*(1e3 * step.after[:2]), "o", color=OBSERVED, markersize=3.0)
    circle = np.linspace(0.0, 2.0 * np.pi, 60)
    ring = goal.pose[:2] + goal.distance * np.column_stack([np.cos(circle), np.sin(circle)])
    axes.plot(*(1e3 * ring.T), color=GOAL_COLOUR, linewidth=1.0)
    _paint_push(axes, step, outline)
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
    axes.label_outer()


def _paint_outline(axes: Axes, outline: Outline, pose: Array, **style: Any) -> None:
    corners = to_world(np.vstack([outline.vertices, outline.vertices[:1]]), pose)
    axes.plot(*(1e3 * corners.T), **style)


def _paint_push(axes: Axes, step: Step, outline: Outline) -> None:
    """Draw an arrow along the path of the tip, up to the first contact."""
    _, contact, angle = step.choice.push.inputs[0]
    point = outline.point(np.array([contact]))[0]
    along = rotate(outline.inward_normal(np.array([contact]))[0], np.array(angle))
    travel = max(step.travel, ARROW)
    tail, head = 1e3 * to_world(np.stack([point - travel * along, point]), step.before)
    axes.annotate("", head, tail, arrowprops={"arrowstyle": "-|>", "color": "black", "linewidth": 1.2})
