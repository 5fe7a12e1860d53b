# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Picture of a long push through the middle of a side: every step has one mode, the outcome has two."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.planning.rollout_truth import repeats
from push_predictor.geometry.frames import rotate, to_world
from push_predictor.geometry.outline import Outline
from push_predictor.models.tabulated.tabulated_model import TabulatedModel
from push_predictor.planning.rollout import rollout
from push_predictor.reporting.canvas import OBSERVED, PREDICTED, START, draw
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SPEED, CONTACT, ANGLE = 0.02, 0.125, 0.0
TIMES = np.array([0.2, 5.0, 9.4])  # s
COUNT = 500  # samples, and repeats on the simulator
DRAWN = 40  # outlines of each
BINS = 20


def draw_rollout(tabulated: TabulatedModel, path: Path) -> None:
    """Draw the push."""
    outline = tabulated.model.rig.outline
    inward = outline.inward_normal(np.array([CONTACT]))[0]
    ahead = np.arctan2(inward[1], inward[0])
    truth = repeats(CONTACT, ANGLE, SPEED, TIMES, COUNT, 500).poses
    steps = [np.array([[SPEED, CONTACT, ANGLE, float(time)]]) for time in TIMES]
    # One seed: the samples of a shorter push are those of the longer one at that time.
    predicted = [rollout(tabulated, np.zeros(3), np.zeros((3, 3)), step, COUNT).samples for step in steps]
    draw(path, (9.0, 5.6), lambda figure: _paint(figure, outline, ahead, predicted, truth))


def _paint(figure: Figure, outline: Outline, ahead: float, predicted: list[Array], truth: Array) -> None:
    axes = figure.subplots(2, len(TIMES), height_ratios=[1.55, 1.0])
    for column, time in enumerate(TIMES):
        above, below = axes[:, column]
        _paint_sliders(above, outline, ahead, predicted[column], truth[column])
        above.set_title(f"after {1e3 * SPEED * time:.0f} mm")
        widest = np.degrees(max(np.abs(poses[column][:, 2]).max() for poses in (predicted, truth)))
        bins = np.linspace(-widest, widest, BINS + 1)
        for poses, colour, label in ((predicted[column], PREDICTED, "rollout"), (truth[column], OBSERVED, "simulator")):
            below.hist(np.degrees(poses[:, 2]), bins, histtype="step", color=colour, linewidth=1.6, label=label)
        below.set_xlabel("heading (deg)")
    axes[0, 0].set_ylabel("along the push (mm)")
    axes[1, 0].set_ylabel(f"of {COUNT}")
    axes[1, 0].legend(loc="upper left")


def _paint_sliders(axes: Axes, outline: Outline, ahead: float, predicted: Array, truth: Array) -> None:
    start = rotate(np.vstack([outline.vertices, outline.vertices[:1]]), np.array(np.pi / 2.0 - ahead))
    axes.plot(*(1e3 * start.T), color=START, linewidth=1.2)
    for poses, colour in ((predicted, PREDICTED), (truth, OBSERVED)):
        turned = np.column_stack([rotate(poses[:, :2], np.array(np.pi / 2.0 - ahead)), poses[:, 2]])
        for pose in turned[:DRAWN]:
            axes.plot(*(1e3 * to_world(start, pose).T), color=colour, linewidth=0.5, alpha=0.22)
        axes.plot(*(1e3 * turned[:, :2].T), ".", color=colour, markersize=2.2, alpha=0.6, zorder=3)
    axes.set(xlim=(-145, 145), ylim=(-70, 265), aspect="equal", xlabel="across (mm)")
