# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Predicted 95 % ellipses with observed outcomes and the slider, for a few pushes at different contacts and angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.evaluation.report.maps import arc_length, sector_length
from push_predictor.evaluation.validation import Comparison
from push_predictor.geometry.frames import rotate, to_world
from push_predictor.geometry.outline import Outline
from push_predictor.models.predictors.tails import Tails, half_widths, joint_radius
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.canvas import (
    NEARBY,
    OBSERVED,
    PREDICTED,
    START,
    SYMBOLS,
    UNIT_NAMES,
    UNITS,
    grid,
    output_label,
    outside_legend,
)
from push_predictor.types import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

LEVEL = 0.95
ACROSS = 2  # examples side by side
DOTS: dict[str, Any] = {"color": NEARBY, "markersize": 3, "alpha": 0.7, "mew": 0.0}
DIAMOND: dict[str, Any] = {"color": OBSERVED, "markersize": 5}
NEAR_CONTACT = 0.1  # of a sector's length
NEAR_ANGLE = np.radians(10.0)
NEAR_SPEED = 0.1  # relative
ENOUGH = 5  # neighbours, of at least two pushes, make a window a good example
STEPS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
VISIBLE = 0.2  # of the slider's size: the largest motion drawn


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


@dataclass(frozen=True, eq=False)
class Example:
    """A window (row of the table), and the outcomes (m, 3) of windows with similar inputs, of that many pushes.

    The outcomes are shifted by the difference of the predicted means, so that they show the unexplained part only.
    """

    row: int
    nearby: Array
    pushes: int


def examples(outline: Outline, table: PushTable, comparison: Comparison, count: int) -> list[Example]:
    """Choose up to `count` windows of different pushes, spread over contact and angle; prefer those with neighbours."""
    where = _scaled_inputs(outline, table)
    near = [_near(outline, table, where, row) for row in range(len(table))]
    pushes = [len(set(table.push_id[rows].tolist())) for rows in near]
    eligible = np.array([row for row in range(len(table)) if near[row].size >= ENOUGH and pushes[row] > 1])
    pool = eligible if eligible.size else np.arange(len(table))
    chosen = pool[spread_rows(where[pool][:, :2], table.push_id[pool], count)]
    return [Example(int(row), _moved(comparison, int(row), near[row]), pushes[row]) for row in chosen]


def spread_rows(points: Array, push_id: np.ndarray, count: int) -> IntArray:
    """Indices of up to `count` points (n, 2) of different pushes, far from each other, sorted by the second column."""
    span = np.maximum(np.ptp(points, axis=0), 1e-12)
    scaled = (points - points.min(axis=0)) / span
    chosen = [int(np.argmin(np.linalg.norm(scaled - 0.5, axis=1)))]
    while len(chosen) < count:
        distance = np.min(np.linalg.norm(scaled[:, None] - scaled[chosen][None], axis=2), axis=1)
        distance[np.isin(push_id, push_id[chosen])] = -1.0
        if distance.max() < 0.0:
            break
        chosen.append(int(np.argmax(distance)))
    rows = np.array(chosen, dtype=np.int64)
    return rows[np.argsort(points[rows, 1], kind="stable")]


def _scaled_inputs(outline: Outline, table: PushTable) -> Array:
    """Contact (zero on a circle), angle and log speed (n, 3), scaled so that similar windows are at most 1 apart."""
    velocity, contact, angle = table.inputs.T
    along = arc_length(outline, contact) / (NEAR_CONTACT * sector_length(outline))
    if outline.rotational_symmetry == 0:
        along = np.zeros_like(along)
    return np.column_stack([along, angle / NEAR_ANGLE, np.log(velocity) / NEAR_SPEED])


def _near(outline: Outline, table: PushTable, where: Array, row: int) -> IntArray:
    apart = np.abs(where - where[row])
    if outline.semi_axes is not None:  # the arc length of a smooth outline is periodic
        apart[:, 0] = np.minimum(apart[:, 0], 1.0 / NEAR_CONTACT - apart[:, 0])
    same_duration = np.isclose(table.duration, table.duration[row], rtol=NEAR_SPEED)
    like = np.all(apart <= 1.0, axis=1) & same_duration
    like[row] = False
    return np.flatnonzero(like)


def _moved(comparison: Comparison, row: int, rows: IntArray) -> Array:
    return np.asarray(comparison.observed[rows] - comparison.mean[rows] + comparison.mean[row])


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
