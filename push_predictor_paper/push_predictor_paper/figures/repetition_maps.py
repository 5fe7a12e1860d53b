# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's two large figures: maps over contact and angle, model above, repetitions below, examples between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.report.figures.ellipses import magnification, paint_slider, start_pose
from push_predictor.evaluation.report.maps import ColourScale, colour_scale
from push_predictor.geometry.frames import to_world
from push_predictor.recordings.rig import Rig
from push_predictor.reporting.canvas import EMPTY, OBSERVED, SYMBOLS, UNIT_NAMES, UNITS, outside_legend
from push_predictor.types import Array
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.statistics.grid_maps import place_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

MOST_DRAWN = 40  # repetitions of a push
LIMIT = 10.0  # standard errors
NAMED = {"mean": "largest |mean|", "sd": "largest sd"}


def paint_map_figure(
    figure: Figure,
    grid: RepeatedGrid,
    quantity: str,
    model: tuple[Array, Array, Array],
    examples: Sequence[tuple[Repetitions, Array]],
) -> None:
    """Draw a column per output. model: contacts (C,), angles (A,), map (A, C, 3) of the quantity, 'mean' or 'sd'.

    examples: for each column a push of the grid, and the model's mean (3,) for it.
    """
    axes = figure.subplots(4, 3, height_ratios=(1.0, 0.62, 1.0, 0.05))
    repeated = getattr(grid, quantity)
    for k, column in enumerate(axes.T):
        shown = [model[2][..., k] * UNITS[k], repeated[..., k] * UNITS[k]]
        scale = colour_scale(shown)
        paint_map(column[0], model[0], model[1], shown[0], scale)
        image = paint_map(column[2], grid.fractions, grid.angles, shown[1], scale)
        for ax in (column[0], column[2]):
            _mark(ax, *[(example.fraction, example.angle) for example, _ in examples][k])
        _paint_repetitions(column[1], grid.rig, *examples[k])
        name = f"{'' if quantity == 'mean' else 'sd of '}{SYMBOLS[k]} ({UNIT_NAMES[k]})"
        column[0].set_title(name)
        bar = figure.colorbar(image, cax=column[3], label=name, extend=scale.extend, orientation="horizontal")
        bar.ax.locator_params(nbins=6)
    axes[0, 0].set_ylabel("VHGP\npush angle (deg)")
    axes[2, 0].set_ylabel("repetitions\npush angle (deg)")
    for ax in axes[2]:
        ax.set_xlabel("contact, fraction of the side")
    marked = figure.axes[0].plot([], [], "o", markersize=9, markerfacecolor="none", markeredgecolor=OBSERVED)
    outside_legend(
        figure, marked, [f"{NAMED[quantity]} by repetitions: the push shown in the middle row"], side="above"
    )


def paint_differences(figure: Figure, grid: RepeatedGrid, parts: Sequence[tuple[str, Array, Array]]) -> None:
    """Draw two rows per quantity: model minus repetitions (A, C, 3) in SI, and in standard errors."""
    axes = figure.subplots(2 * len(parts), 3, sharex=True, sharey=True, squeeze=False)
    errors = ColourScale(-LIMIT, LIMIT, "PuOr", "both")
    for (plain, standard), (name, differences, of_error) in zip(axes.reshape(-1, 2, 3), parts, strict=True):
        for k, ax in enumerate(plain):
            values = differences[..., k] * UNITS[k]
            most = float(np.nanpercentile(np.abs(values), 98.0))
            image = paint_map(ax, grid.fractions, grid.angles, values, ColourScale(-most, most, "PuOr", "both"))
            figure.colorbar(image, ax=ax, extend="both", label=UNIT_NAMES[k]).ax.locator_params(nbins=5)
            ax.set_title(f"{name} of {SYMBOLS[k]}: VHGP minus repetitions")
        for k, ax in enumerate(standard):
            image = paint_map(ax, grid.fractions, grid.angles, of_error[..., k], errors)
            figure.colorbar(image, ax=ax, extend="both", label="standard errors")
            ax.set_title("the same in standard errors")
    for ax in axes[:, 0]:
        ax.set_ylabel("push angle (deg)")
    for ax in axes[-1]:
        ax.set_xlabel("contact, fraction of the side")


def paint_map(ax: Axes, fractions: Array, angles: Array, values: Array, scale: ColourScale) -> ScalarMappable:
    """Draw one map (A, C) in shown units; unknown pushes are grey and hatched."""
    from matplotlib.colors import Normalize

    ax.set_facecolor(EMPTY)
    ax.patch.set_hatch("////")
    edges = (_edges(fractions), np.degrees(_edges(angles)))
    image = ax.pcolormesh(*edges, values, cmap=scale.name, norm=Normalize(scale.low, scale.high), rasterized=True)
    ax.set(xlim=(edges[0][0], edges[0][-1]), ylim=(edges[1][0], edges[1][-1]), yticks=(-60, 0, 60))
    ax.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0], ["0", "0.25", "0.5", "0.75", "1"])
    for side in ("top", "right"):
        ax.spines[side].set_visible(True)
    return image


def _mark(ax: Axes, fraction: float, angle: float) -> None:
    """Mark the push that is drawn between the maps."""
    place = (fraction, np.degrees(angle))
    ax.plot(*place, "o", markersize=9, markerfacecolor="none", markeredgecolor="white", markeredgewidth=3.0)
    ax.plot(*place, "o", markersize=9, markerfacecolor="none", markeredgecolor=OBSERVED, markeredgewidth=1.5)


def _paint_repetitions(ax: Axes, rig: Rig, push: Repetitions, predicted: Array) -> None:
    """Draw the final slider of each repetition, of their mean and of the model's mean, and the pusher."""
    inputs, mean = push.inputs.mean(axis=0), push.mean
    enlarged = magnification(rig.outline, mean[None])
    pose, outline = start_pose(rig.outline, inputs), np.vstack([rig.outline.vertices, rig.outline.vertices[:1]])
    for outcome in push.outcomes[:MOST_DRAWN]:
        moved = to_world(outline, pose + enlarged * outcome).T * 1e3
        ax.plot(*moved, color=OBSERVED, linewidth=0.5, alpha=0.3)
    paint_slider(ax, rig, inputs, predicted, mean, enlarged)
    caption = f"{place_text((push.fraction, push.angle))}, motion {enlarged:g}×"
    ax.set_title(caption, fontsize=8.0)


def _edges(centres: Array) -> Array:
    middle = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate([[2 * centres[0] - middle[0]], middle, [2 * centres[-1] - middle[-1]]])
