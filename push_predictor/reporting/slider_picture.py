# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A slider seen from above: its outline, a goal, and a push, on axes in mm. Input is in m and rad."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.geometry.frames import rotate, to_world
from push_predictor.geometry.outline import Outline
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GOAL_COLOUR, OBSTACLE_COLOUR = "#009E73", "#8a8a8a"
ARROW = 0.012  # m, at least


def paint_outline(axes: Axes, outline: Outline, pose: Array, **style: Any) -> None:
    """Draw the outline at a pose (3,)."""
    corners = to_world(np.vstack([outline.vertices, outline.vertices[:1]]), pose)
    axes.plot(*(1e3 * corners.T), **style)


def paint_goal(axes: Axes, outline: Outline, pose: Array, distance: float) -> None:
    """Draw the outline at the goal's pose (3,), and the tolerance of its position."""
    paint_outline(axes, outline, pose, color=GOAL_COLOUR, linestyle="--", label="goal")
    paint_circle(axes, pose[:2], distance, color=GOAL_COLOUR, linewidth=1.0)


def paint_circle(axes: Axes, centre: Array, radius: float, **style: Any) -> None:
    """Draw a circle about a point (2,)."""
    turn = np.linspace(0.0, 2.0 * np.pi, 60)
    ring = centre + radius * np.column_stack([np.cos(turn), np.sin(turn)])
    axes.plot(*(1e3 * ring.T), **style)


def paint_push(axes: Axes, outline: Outline, slider: Array, push: Array, travel: float) -> None:
    """Draw an arrow along the path of the tip, up to the first contact with a slider (3,); push (3,): its inputs."""
    _, contact, angle = push
    point = outline.point(np.array([contact]))[0]
    along = rotate(outline.inward_normal(np.array([contact]))[0], np.array(angle))
    tail, head = 1e3 * to_world(np.stack([point - max(travel, ARROW) * along, point]), slider)
    axes.annotate("", head, tail, arrowprops={"arrowstyle": "-|>", "color": "black", "linewidth": 1.2})
