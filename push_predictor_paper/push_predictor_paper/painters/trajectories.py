# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Repetitions of a push: trajectories of the slider's centre, and where the slider ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.report.figures.ellipses import (
    ellipse,
    magnification,
    paint_slider,
    start_pose,
)
from push_predictor.geometry.frames import rotate, to_world
from push_predictor.recordings.rig import Rig
from push_predictor.reporting.canvas import COLOURS, OBSERVED, START, grid, outside_legend
from push_predictor.types import Array
from push_predictor_paper.data.repetitions import Repetitions
from push_predictor_paper.plan import GRID_TRAVEL
from push_predictor_paper.statistics.grid_maps import place_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GREEN, RED, TIP = COLOURS[2], COLOURS[1], "#6b6b6b"
MOST_DRAWN = 40  # repetitions of a push


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Repetitions of one push: typical inputs (3,), paths (r, t, 3) in m, m, rad along the push."""

    title: str
    inputs: Array
    paths: Array


def paint_trajectories(figure: Figure, rig: Rig, shown: Sequence[Trajectories]) -> None:
    """Draw a column per push: slider and trajectories, trajectories enlarged, final poses enlarged further."""
    rows = figure.subplots(3, len(shown), squeeze=False, height_ratios=(1.2, 1.0, 1.1))
    for (scene, paths, ends), push in zip(rows.T, shown, strict=True):
        _paint_scene(scene, rig, push)
        _paint_paths(paths, push)
        _paint_ends(ends, push)
    for row, name in zip(
        rows, ("across (mm)", "path of the centre, across (mm)", "final pose, across (mm)"), strict=True
    ):
        _alike(row)
        row[0].set_ylabel(name)
    marks = {n: mark for ax in rows[:, 0] for mark, n in zip(*ax.get_legend_handles_labels(), strict=True)}
    outside_legend(figure, list(marks.values()), list(marks), side="above", ncols=len(marks))


def _alike(axes: Sequence[Axes]) -> None:
    """Give the panels of a row one scale, each about its own centre."""
    limits = np.array([[ax.get_xlim(), ax.get_ylim()] for ax in axes])
    half = 0.5 * np.ptp(limits, axis=2).max(axis=0)
    for ax, middle in zip(axes, limits.mean(axis=2), strict=True):
        ax.set(xlim=(middle[0] - half[0], middle[0] + half[0]), ylim=(middle[1] - half[1], middle[1] + half[1]))
        ax.set_aspect("equal")


def _paint_scene(ax: Axes, rig: Rig, push: Trajectories) -> None:
    pose = start_pose(rig.outline, push.inputs)
    contact, travel = push.inputs[1:2], 1e3 * GRID_TRAVEL
    corners = rig.outline.point(np.linspace(0.0, 1.0, 400, endpoint=False))
    ax.fill(*(to_world(corners, pose).T * 1e3), facecolor="0.95", edgecolor=START, label="slider at the start")
    tip = -1e3 * rig.pusher_radius * rotate(rig.outline.inward_normal(contact)[0], pose[2])
    turn = np.linspace(0.0, 2.0 * np.pi, 61)
    disc = tip + 1e3 * rig.pusher_radius * np.column_stack([np.cos(turn), np.sin(turn)])
    ax.fill(*disc.T, facecolor="0.8", edgecolor=TIP, linewidth=0.8)
    arrow = {"arrowstyle": "-|>", "color": TIP, "shrinkA": 0.0, "shrinkB": 0.0}
    ax.annotate("", (travel + tip[0], tip[1]), (tip[0], tip[1]), arrowprops=arrow)
    ax.plot([], [], color=TIP, label="tip and its path")
    for path in push.paths:
        ax.plot(*(1e3 * (pose[:2] + path[:, :2]).T), color=GREEN, linewidth=0.5, alpha=0.5)
    ax.set(title=push.title, xlabel="along the push (mm)")


def _paint_paths(ax: Axes, push: Trajectories) -> None:
    grid(ax)
    for number, path in enumerate(push.paths):
        name = "slider's centre" if number == 0 else None
        ax.plot(*(1e3 * path[:, :2].T), color=GREEN, linewidth=0.5, alpha=0.5, label=name)
    ax.set_xlabel("path of the centre, along (mm)")


def _paint_ends(ax: Axes, push: Trajectories) -> None:
    grid(ax)
    ends = 1e3 * (push.paths[:, -1, :2] - push.paths[:, -1, :2].mean(axis=0))
    ax.plot(*ends.T, ".", color="0.15", markersize=3.0, label="final pose")
    ax.plot(*ellipse(np.cov(ends.T), None).T, color=RED, linewidth=1.3, label="95 % ellipse of final poses")
    ax.set_xlabel("final pose, along, from the mean (mm)")


def paint_outcomes(ax: Axes, rig: Rig, push: Repetitions, predicted: Array) -> None:
    """Draw the final slider of each repetition, of their mean and of the model's mean (3,), and the pusher."""
    inputs, mean = push.inputs.mean(axis=0), push.mean
    enlarged = magnification(rig.outline, mean[None])
    pose, outline = start_pose(rig.outline, inputs), np.vstack([rig.outline.vertices, rig.outline.vertices[:1]])
    for outcome in push.outcomes[:MOST_DRAWN]:
        moved = to_world(outline, pose + enlarged * outcome).T * 1e3
        ax.plot(*moved, color=OBSERVED, linewidth=0.5, alpha=0.3)
    paint_slider(ax, rig, inputs, predicted, mean, enlarged)
    ax.set_title(f"{place_text((push.fraction, push.angle))}, motion {enlarged:g}×", fontsize=8.0)
