# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The picture of an MPC's run: the paths of slider and tip, and what was planned where the tip was placed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.planning.goal import Goal
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.reporting.canvas import NEARBY, OBSERVED, PREDICTED, draw, outside_legend
from push_predictor.reporting.slider_picture import OBSTACLE_COLOUR, paint_goal, paint_outline
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SIZE = (6.4, 4.6)  # inches
BETWEEN = 12  # windows between two plans that are drawn
ELLIPSE = 2.4477  # standard deviations: 95 % in two dimensions


@dataclass(frozen=True, eq=False)
class Window:
    """One window: slider (3,) and tip (2,) at its start, and whether the tip had just been placed.

    poses (h, 3), covariance (h, 3, 3): predicted for it and the windows ahead; planning: time taken, s.
    """

    slider: Array
    tip: Array
    placed: bool
    poses: Array
    covariance: Array
    planning: float


def draw_windows(path: Path, windows: Sequence[Window], after: Array, goal: Goal, scene: Scene) -> Path:
    """Draw a run that left the slider at (3,). Raises PushPredictorError if matplotlib is not installed."""
    return draw(path, SIZE, lambda figure: _paint(figure, windows, after, goal, scene))


def _paint(figure: Figure, windows: Sequence[Window], after: Array, goal: Goal, scene: Scene) -> None:
    axes = figure.subplots()
    for obstacle in scene.obstacles:
        axes.fill(*(1e3 * obstacle.vertices.T), color=OBSTACLE_COLOUR, label="obstacle")
    paint_goal(axes, scene.outline, goal.pose, goal.distance)
    placed = [k for k, window in enumerate(windows) if window.placed]
    for number, (first, end) in enumerate(pairwise([*placed, len(windows)]), 1):
        paint_outline(axes, scene.outline, windows[first].slider, color=NEARBY, linewidth=0.9, label="before a contact")
        for window in windows[first:end:BETWEEN]:
            _paint_ellipses(axes, window)
        tips = 1e3 * np.array([window.tip for window in windows[first:end]])
        axes.plot(*tips.T, ".-", color="black", markersize=3.0, linewidth=0.8, label="tip, every 0.1 s")
        axes.annotate(f"{number}", tips[0], (0.0, -14.0), ha="center", textcoords="offset points")
    centres = 1e3 * np.array([*(window.slider for window in windows), after])
    axes.plot(*centres[:, :2].T, ".-", color=OBSERVED, markersize=3.0, linewidth=1.0, label="centre, every 0.1 s")
    paint_outline(axes, scene.outline, after, color=OBSERVED, label="after")
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
    entries = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))  # each label once
    outside_legend(figure, list(entries.values()), list(entries), side="below", ncols=3)


def _paint_ellipses(axes: Axes, window: Window) -> None:
    """Draw the 95 % ellipses of the centre in the windows ahead."""
    turn = np.linspace(0.0, 2.0 * np.pi, 60)
    circle = ELLIPSE * np.column_stack([np.cos(turn), np.sin(turn)])
    for mean, covariance in zip(window.poses, window.covariance, strict=True):
        ring = 1e3 * (mean[:2] + circle @ np.linalg.cholesky(covariance[:2, :2]).T)
        axes.plot(*ring.T, color=PREDICTED, linewidth=0.8, label="centre as planned, 95 %")
