# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What an environment renders: the scene, the goal, the slider and the push that brought it there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from push_predictor.gym.pushed_sliders import PushedSliders
from push_predictor.planning.straight_drive import start_drive
from push_predictor.reporting.canvas import NEARBY, OBSERVED, pixels
from push_predictor.reporting.slider_picture import OBSTACLE_COLOUR, paint_circle, paint_goal, paint_outline, paint_push
from push_predictor.types import ByteArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIZE = (4.0, 4.0)  # inches: 640 x 640 pixels


def frame(sliders: PushedSliders, row: int) -> ByteArray:
    """Pixels (height, width, 3) of one slider. Raises PushPredictorError if matplotlib is not installed."""
    return pixels("render", SIZE, lambda figure: _paint(figure, sliders, row))


def _paint(figure: Figure, sliders: PushedSliders, row: int) -> None:
    task, axes = sliders.task, figure.subplots()
    scene, goal, inputs = task.scene, task.goal, sliders.inputs[row]
    axes.fill(*(1e3 * scene.table.vertices.T), facecolor="none", edgecolor=NEARBY)
    for obstacle in scene.obstacles:
        axes.fill(*(1e3 * obstacle.vertices.T), color=OBSTACLE_COLOUR)
    paint_goal(axes, scene.outline, goal.pose, goal.distance)
    if np.isfinite(inputs).all():
        before, radius = sliders.before[row], task.model.model.rig.pusher_radius
        paint_outline(axes, scene.outline, before, color=NEARBY, linewidth=0.9)
        tip = start_drive(scene.outline, radius, before[None], inputs[None])[0].start[0]
        paint_circle(axes, tip, radius, color="black", linewidth=1.2)
        paint_push(axes, scene.outline, before, inputs, inputs[0] * task.model.model.usual_duration)
    paint_outline(axes, scene.outline, sliders.poses[row], color=OBSERVED)
    left, bottom = 1e3 * (scene.table.vertices.min(axis=0) - scene.outline.reach)
    right, top = 1e3 * (scene.table.vertices.max(axis=0) + scene.outline.reach)
    axes.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)", xlim=(left, right), ylim=(bottom, top))
