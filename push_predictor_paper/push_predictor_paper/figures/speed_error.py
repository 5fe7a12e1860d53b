# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""NMSE and bias of the models by the pusher's speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.reporting.canvas import grid, outside_legend
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.figures.curves import KIND_LOOKS, TICKS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class SpeedCurve:
    """One kind of model by speed (m/s): NMSE within it, bias along and across as shares of the travel."""

    kind: str
    speeds: tuple[float, ...]
    nmse: tuple[Estimate, ...]
    along: tuple[Estimate, ...]
    across: tuple[Estimate, ...]


def paint_speed_error(figure: Figure, curves: Sequence[SpeedCurve], names: Mapping[str, str]) -> None:
    """Draw three panels by speed: NMSE, bias along, bias across."""
    axes = figure.subplots(1, 3)
    for curve in curves:
        for ax, points, unit in zip(axes, (curve.nmse, curve.along, curve.across), (1.0, 100.0, 100.0), strict=True):
            _paint(ax, curve, points, unit, names[curve.kind])
    axes[0].set_yscale("log")
    axes[0].set_yticks(TICKS, [f"{tick:g}" for tick in TICKS])
    speeds = [speed for curve in curves for speed in curve.speeds]
    _frame(axes[0], speeds, "NMSE within the speed", "NMSE, sum of 3")
    _frame(axes[1], speeds, "bias along the push", "observed − predicted (% of travel)")
    _frame(axes[2], speeds, "bias across the push", "observed − predicted (% of travel)")
    values = [v for curve in curves for e in curve.nmse for v in (e.value, e.low, e.high) if np.isfinite(v) and v > 0]
    axes[0].set_ylim(min(values) / 1.2, max(values) * 1.2)
    axes[0].set_yticks([], minor=True)
    for ax in axes[1:]:
        ax.axhline(0.0, color="0.2", linewidth=0.8, linestyle=":")
    handles, labels = axes[0].get_legend_handles_labels()
    outside_legend(figure, handles, labels, side="above", ncols=len(labels), handlelength=2.6)


def _paint(ax: Axes, curve: SpeedCurve, points: Sequence[Estimate], unit: float, name: str) -> None:
    colour, dashes, marker = KIND_LOOKS[curve.kind]
    speed = 1e3 * np.asarray(curve.speeds)
    value, low, high = (unit * np.array([getattr(p, end) for p in points]) for end in ("value", "low", "high"))
    ax.fill_between(speed, low, high, color=colour, alpha=0.15, linewidth=0.0)
    ax.plot(speed, value, color=colour, linestyle=dashes, marker=marker or None, markersize=3.5, label=name)


def speed_axis(ax: Axes, speeds: Sequence[float]) -> None:
    """Make the horizontal axis logarithmic, in mm/s, for speeds in m/s."""
    low, high = 1e3 * min(speeds) / 1.15, 1e3 * max(speeds) * 1.15
    ticks = [tick for tick in (10, 20, 50, 100, 200, 500) if low <= tick <= high]
    ax.set_xscale("log")
    ax.set_xticks(ticks, [str(tick) for tick in ticks])
    ax.set_xticks([], minor=True)
    ax.set_xlim(low, high)


def _frame(ax: Axes, speeds: Sequence[float], title: str, label: str) -> None:
    grid(ax)
    speed_axis(ax, speeds)
    ax.set(title=title, xlabel="speed (mm/s)", ylabel=label)
