# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Histograms of the probability integral transform, and coverage of slow, medium and fast pushes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.reporting.canvas import COLOURS, SYMBOLS, grid, outside_legend
from push_predictor.types import Array
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.statistics.pit import BARS, EDGES, Histogram

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = ("o", "s", "^", "D")
TALLEST = 6.0  # times flat


def paint_pits(figure: Figure, rows: Mapping[str, tuple[Histogram, Histogram]]) -> None:
    """Draw a row per model, a column per output: bars by push with intervals; the random split as an outline."""
    axes = figure.subplots(len(rows), 3, squeeze=False, sharex=True, sharey="row")
    for row, (model, (by_push, random)) in zip(axes, rows.items(), strict=True):
        top = min(TALLEST, 1.08 * BARS * float(np.nanmax([by_push.shares, by_push.high, random.shares])))
        for k, ax in enumerate(row):
            _paint_bars(ax, by_push, random, k)
            _mark_cut_bars(ax, by_push.shares[:, k] * BARS, top)
            ax.set(xlim=(0.0, 1.0), ylim=(0.0, top), xticks=(0.0, 0.5, 1.0))
        row[0].set_ylabel(f"{model}\nwindows, flat = 1")
    for k, ax in enumerate(axes[0]):
        ax.set_title(f"PIT of {SYMBOLS[k]}")
    for ax in axes[-1]:
        ax.set_xlabel("predicted cumulative probability")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    outside_legend(figure, handles, labels, side="above", ncols=4)


def paint_by_speed(figure: Figure, groups: Sequence[str], models: Mapping[str, Sequence[Sequence[Estimate]]]) -> None:
    """Draw a panel per output: coverage of the 95 % intervals by group of speeds; models: [group][output]."""
    axes = figure.subplots(1, 3, sharey=True)
    for k, ax in enumerate(axes):
        grid(ax)
        ax.axhline(0.95, color="0.2", linewidth=1.0, linestyle="--", label="nominal" if k == 0 else None)
        for m, (model, estimates) in enumerate(models.items()):
            shares = [estimate[k] for estimate in estimates]
            place = np.arange(float(len(groups))) + 0.18 * (m - 0.5 * (len(models) - 1))
            _paint_estimates(ax, place, shares, m, model)
        ax.set(
            title=SYMBOLS[k], xticks=np.arange(len(groups)), xticklabels=list(groups), xlim=(-0.5, len(groups) - 0.5)
        )
        ax.set_xlabel("speed of the push (mm/s)")
    axes[0].set_ylabel("coverage of the 95 % interval")
    handles, labels = axes[0].get_legend_handles_labels()
    outside_legend(figure, handles, labels, side="above", ncols=len(labels))


def _paint_bars(ax: Axes, by_push: Histogram, random: Histogram, k: int) -> None:
    middle, shares = 0.5 * (EDGES[:-1] + EDGES[1:]), by_push.shares[:, k]
    look: dict[str, Any] = {"color": COLOURS[k], "alpha": 0.55, "edgecolor": "white", "linewidth": 0.6}
    ax.bar(middle, BARS * shares, 1.0 / BARS, label="by push", **look)
    ends = BARS * np.maximum([shares - by_push.low[:, k], by_push.high[:, k] - shares], 0.0)
    ax.errorbar(middle, BARS * shares, ends, fmt="none", ecolor="0.2", elinewidth=1.0, label="95 % interval")
    ax.stairs(BARS * random.shares[:, k], EDGES, color="0.2", linewidth=0.9, linestyle=":", label="random split")
    ax.axhline(1.0, color="black", linewidth=0.9, linestyle="--", label="flat")


def _mark_cut_bars(ax: Axes, heights: Array, top: float) -> None:
    """Write the height on every bar that leaves the picture."""
    for b in np.flatnonzero(heights > top):
        side = {"ha": "left", "x": EDGES[b] + 0.11} if b < BARS / 2 else {"ha": "right", "x": EDGES[b] - 0.01}
        ax.text(y=0.97 * top, s=f"{heights[b]:.1f}", va="top", fontsize=8, **side)


def _paint_estimates(ax: Axes, place: Array, estimates: Sequence[Estimate], m: int, label: str) -> None:
    value = np.array([e.value for e in estimates])
    ends = np.maximum([value - [e.low for e in estimates], [e.high for e in estimates] - value], 0.0)
    look: dict[str, Any] = {"color": COLOURS[m], "markersize": 4.5, "capsize": 2.5, "linewidth": 0.0, "elinewidth": 1.2}
    ax.errorbar(place, value, ends, fmt=MARKS[m], label=label, **look)
