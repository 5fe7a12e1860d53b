# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Picture of the training data and of the repetitions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import binomtest

from push_predictor.evaluation.report.maps import arc_length, sector_length
from push_predictor.reporting.canvas import COLOURS, grid
from push_predictor_paper.data.corpus import PushSet
from push_predictor_paper.data.repetitions import RepeatedGrid
from push_predictor_paper.figures.speed_error import speed_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class SpeedCount:
    """At one speed (m/s): pushes commanded, pushes with a window, windows; fewest: windows in the poorest set."""

    speed: float
    pushes: int
    with_window: int
    windows: int
    fewest: int


def paint_data(figure: Figure, counts: list[SpeedCount], pushes: PushSet, repeated: RepeatedGrid) -> None:
    """Draw three panels: pushes with a window by speed, inputs of a set, repetitions found."""
    speeds, inputs, seen = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.15))
    _paint_speeds(speeds, counts)
    outline = pushes.rig.outline
    fraction = arc_length(outline, pushes.table.inputs[:, 1]) / sector_length(outline)
    inputs.plot(fraction, np.degrees(pushes.table.inputs[:, 2]), ".", color=COLOURS[0], markersize=2.0, alpha=0.6)
    _frame_of_pushes(inputs)
    inputs.set_title(f"windows of {pushes.rig.shape} on {pushes.rig.surface}")
    _paint_seen(figure, seen, repeated)


def _paint_speeds(ax: Axes, counts: list[SpeedCount]) -> None:
    grid(ax)
    for count in counts:
        ends = binomtest(count.with_window, count.pushes).proportion_ci(method="wilson")
        ax.plot([count.speed * 1e3] * 2, [100 * ends.low, 100 * ends.high], color=COLOURS[0], linewidth=1.2)
        ax.plot(count.speed * 1e3, 100 * count.with_window / count.pushes, "o", color=COLOURS[0], markersize=4)
    speed_axis(ax, [count.speed for count in counts])
    ax.set_ylim(0, 103)
    ax.set_xlabel("commanded speed (mm/s)")
    ax.set_ylabel("pushes with a window (%)")
    ax.set_title("contact for at least 0.2 s")


def _paint_seen(figure: Figure, ax: Axes, repeated: RepeatedGrid) -> None:
    shape = (len(repeated.fractions), len(repeated.angles))
    share = np.reshape([100.0 * len(cell.outcomes) / cell.commanded for cell in repeated.cells], shape).T
    edges = [np.clip(_edges(repeated.fractions), 0.0, 1.0), np.degrees(_edges(repeated.angles)).clip(-90.0, 90.0)]
    image = ax.pcolormesh(*edges, share, cmap="viridis", vmin=0.0, vmax=100.0, edgecolors="white", linewidth=0.3)
    figure.colorbar(image, ax=ax, label="repetitions with a first window (%)")
    _frame_of_pushes(ax)
    ax.set_title(f"repeated pushes on {repeated.surface}")


def _frame_of_pushes(ax: Axes) -> None:
    """Axes that contain every push of a side."""
    ax.set(xlim=(0.0, 1.0), ylim=(-90.0, 90.0), yticks=range(-90, 91, 30))
    ax.set(xlabel="contact, fraction of the side", ylabel="push angle (deg)")


def _edges(centres: np.ndarray) -> np.ndarray:
    middle = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate([[2 * centres[0] - middle[0]], middle, [2 * centres[-1] - middle[-1]]])
