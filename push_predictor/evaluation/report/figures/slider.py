# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The slider before and after a window, in the push frame: the pusher moves to the right from the origin."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from push_predictor.geometry.frames import rotate, to_world
from push_predictor.geometry.outline import Outline
from push_predictor.recordings.rig import Rig
from push_predictor.reporting.canvas import OBSERVED, PREDICTED, START
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STEPS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
VISIBLE = 0.2  # of the slider's size: the largest motion drawn


def paint_slider(ax: Axes, rig: Rig, inputs: Array, predicted: Array, observed: Array, enlarged: float) -> None:
    """Draw the outline at the start (thin), observed and predicted after the window, with the motion magnified."""
    pose = start_pose(rig.outline, inputs)
    shape = _closed(rig.outline)
    for motion, colour, width, style in (
        (np.zeros(3), START, 0.8, "-"),
        (observed, OBSERVED, 1.4, "-"),
        (predicted, PREDICTED, 1.4, (0, (4, 2))),
    ):
        ax.plot(*(to_world(shape, pose + enlarged * motion).T * 1e3), color=colour, linewidth=width, linestyle=style)
    _paint_pusher(ax, rig, inputs, pose)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_axis_off()


def start_pose(outline: Outline, inputs: Array) -> Array:
    """Pose (3,) of the slider in the push frame with the contact point at the origin; inputs (3,) of a model."""
    contact, angle = inputs[1:2], float(inputs[2])
    normal = outline.inward_normal(contact)[0]
    heading = -(np.arctan2(normal[1], normal[0]) + angle)
    centre = -rotate(outline.point(contact)[0], np.array(heading))
    return np.array([centre[0], centre[1], heading])


def magnification(outline: Outline, outcomes: Array) -> float:
    """The largest of 1, 2, 5, ... that keeps the largest motion (n, 3) within a fifth of the slider's size."""
    size = float(np.max(np.ptp(_closed(outline), axis=0)))
    moved = np.hypot(outcomes[:, 0], outcomes[:, 1]) + 0.5 * size * np.abs(outcomes[:, 2])
    return max((step for step in STEPS if step * moved.max() <= VISIBLE * size), default=STEPS[0])


def _closed(outline: Outline) -> Array:
    points = outline.point(np.linspace(0.0, 1.0, 181)[:-1]) if outline.semi_axes is not None else outline.vertices
    return np.vstack([points, points[:1]])


def _paint_pusher(ax: Axes, rig: Rig, inputs: Array, pose: Array) -> None:
    normal = rotate(rig.outline.inward_normal(inputs[1:2])[0], pose[2])
    turn = np.linspace(0.0, 2.0 * np.pi, 61)
    disc = rig.pusher_radius * (np.stack([np.cos(turn), np.sin(turn)], axis=1) - normal)
    ax.fill(*(disc.T * 1e3), facecolor="0.35", linewidth=0.0)
    tail, tip = -5.0 * rig.pusher_radius - rig.pusher_radius * normal[0], -2.0 * rig.pusher_radius
    height = -rig.pusher_radius * normal[1] * 1e3
    arrow = {"arrowstyle": "-|>", "color": "0.35", "linewidth": 1.2, "shrinkA": 0.0, "shrinkB": 0.0}
    ax.update_datalim([(tail * 1e3, height)])  # an arrow does not extend the limits
    ax.annotate("", (tip * 1e3, height), (tail * 1e3, height), arrowprops=arrow)
