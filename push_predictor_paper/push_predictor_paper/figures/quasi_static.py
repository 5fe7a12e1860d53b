# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The quasi-static claim: error by top speed, map of errors by speed, departure from the slowest pushes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.reporting.canvas import COLOURS, grid, outside_legend
from push_predictor.types import Array
from push_predictor_paper.data.time_scaled import TURN
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.figures.curves import look_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DODGE = 0.012  # of a decade, so that intervals do not overlap


@dataclass(frozen=True)
class Curve:
    """A series of models with a point for each top speed."""

    label: str
    points: tuple[Estimate, ...]


def paint_quasi_static(
    figure: Figure,
    tops: Sequence[float],
    same: Sequence[Curve],
    slow: Sequence[Curve],
    single: Array,
    speeds: Sequence[float],
    departures: Sequence[Estimate],
    levels: Mapping[str, float],
) -> None:
    """Draw four panels. tops, speeds: m/s; single: NMSE (tested at, trained up to); levels: lines for comparison."""
    (first, second), (third, fourth) = figure.subplots(2, 2)
    second.sharey(first)
    for ax, curves, title in (
        (first, same, "on held-out pushes of the same speeds"),
        (second, slow, "on the slowest held-out pushes"),
    ):
        _paint_curves(ax, tops, curves)
        ax.set(title=title, xlabel="top speed of the training pushes (mm/s)", ylabel="NMSE, sum of 3")
    handles, labels = first.get_legend_handles_labels()
    outside_legend(figure, handles, labels, side="above", ncols=len(labels), handlelength=2.6)
    _paint_map(figure, third, tops, single)
    _paint_departure(fourth, speeds, departures, levels)


def _paint_curves(ax: Axes, tops: Sequence[float], curves: Sequence[Curve]) -> None:
    _frame(ax, tops)
    for number, curve in enumerate(curves):
        colour, dashes, marker = look_of(number)
        at = 1e3 * np.asarray(tops) * 10.0 ** (DODGE * (number - 0.5 * (len(curves) - 1)))
        value, low, high = (np.array([getattr(p, end) for p in curve.points]) for end in ("value", "low", "high"))
        ax.vlines(at, low, high, color=colour, linewidth=0.9, alpha=0.7)
        ax.plot(at, value, color=colour, linestyle=dashes, marker=marker, markersize=4, label=curve.label)
    known = [(p.value, p.high) for curve in curves for p in curve.points if np.isfinite(p.high)]
    if known:  # wide intervals from few pushes must not flatten the rest
        top_value, top_end = np.max(known, axis=0)
        ax.set_ylim(0.0, min(1.7 * top_value, 1.05 * top_end))


def _paint_map(figure: Figure, ax: Axes, tops: Sequence[float], single: Array) -> None:
    from matplotlib.colors import LogNorm

    known = single[np.isfinite(single)]
    low, high = float(known.min()), float(max(known.max(), 1.01 * known.min()))
    norm = LogNorm(low, high)
    image = ax.pcolormesh(np.ma.masked_invalid(single), cmap="viridis_r", norm=norm, edgecolors="white", linewidth=0.4)
    dark = np.sqrt(low * high)
    for (row, column), value in np.ndenumerate(single):
        if np.isfinite(value):
            colour = "white" if value > dark else "black"
            ax.text(column + 0.5, row + 0.5, f"{value:.2f}", ha="center", va="center", fontsize=6.5, color=colour)
    ticks, names = np.arange(len(tops)) + 0.5, [f"{1e3 * top:.0f}" for top in tops]
    ax.set_xticks(ticks, names)
    ax.set_yticks(ticks, names)
    ax.set(title="VHGP without the speed", xlabel="trained up to (mm/s)", ylabel="tested at (mm/s)")
    bar = figure.colorbar(image, ax=ax, label="NMSE, sum of 3")
    marks = [mark for mark in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0) if low <= mark <= high]
    bar.set_ticks(marks, labels=[f"{mark:g}" for mark in marks])
    bar.ax.minorticks_off()


def _paint_departure(
    ax: Axes, speeds: Sequence[float], departures: Sequence[Estimate], levels: Mapping[str, float]
) -> None:
    _frame(ax, speeds)
    at = 1e3 * np.asarray(speeds)
    value, low, high = (np.array([getattr(d, end) for d in departures]) for end in ("value", "low", "high"))
    ax.fill_between(at, low, high, color=COLOURS[0], alpha=0.15, linewidth=0.0)
    ax.plot(at, value, "o-", color=COLOURS[0], markersize=4)
    for (name, level), dashes in zip(levels.items(), ("--", ":"), strict=True):
        ax.axhline(level, color="0.2", linewidth=0.9, linestyle=dashes, label=name)
    ax.set_ylim(0.0, 1.3 * max([*high.tolist(), *(v for v in levels.values() if np.isfinite(v))]))
    ax.legend(loc="upper left")
    label = f"departure from {1e3 * speeds[0]:.0f} mm/s (NMSE)"
    ax.set(title="the same push at another speed", xlabel="speed (mm/s)", ylabel=label)


def _frame(ax: Axes, speeds: Sequence[float]) -> None:
    grid(ax)
    ax.set_xscale("log")
    ticks = [tick for tick in (10, 20, 50, 100, 200, 500) if tick <= 1.01e3 * max(speeds)]
    ax.set_xticks(ticks, [str(tick) for tick in ticks])
    ax.set_xticks([], minor=True)
    ax.axvspan(1e3 * TURN[0], 1e3 * TURN[1], color="0.88", linewidth=0.0, zorder=0)
