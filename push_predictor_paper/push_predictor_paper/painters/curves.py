# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Curves with intervals, in panels: by training size, by speed, or as cumulative shares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.reporting.canvas import COLOURS, grid, outside_legend
from push_predictor.types import Array
from push_predictor_paper.fits.crossing import Crossing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Look = tuple[str, object, str]  # colour, dashes, marker
LOOKS: tuple[Look, ...] = (
    (COLOURS[0], "-", "o"),
    (COLOURS[1], "--", "s"),
    (COLOURS[2], "-.", "^"),
    ("#CC79A7", (0, (1, 1.2)), "D"),  # a fourth of Okabe and Ito
)
KIND_LOOKS: dict[str, Look] = {
    "analytical": ("#4d4d4d", "--", ""),
    "gp": ("#D55E00", "-", "s"),
    "vhgp": ("#0072B2", "-", "o"),
}
SPEED_TICKS = (10, 20, 50, 100, 200, 500)  # mm/s
TICKS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
MOST_NLPD = 11.0  # nats shown above the lowest point; tiny training sets give far more
MOST_NMSE = 6.0


@dataclass(frozen=True)
class Line:
    """A curve through points at x (n,). thin: a single member of a group, without interval and name.

    banded: its intervals are a band, else whiskers. steps: a cumulative share.
    """

    label: str
    look: Look
    x: Sequence[float]
    points: Sequence[Estimate]
    thin: bool = False
    banded: bool = True
    steps: bool = False


@dataclass(frozen=True)
class Panel:
    """One pair of axes, the horizontal one logarithmic.

    ratio: a logarithmic vertical axis; shaded: a range of x; levels: horizontal lines by
    name; crossings: colour and place, marked at the foot; limits: of the vertical axis.
    """

    title: str
    across: str
    up: str
    lines: Sequence[Line]
    ticks: Sequence[float] = ()
    ratio: bool = False
    shaded: tuple[float, float] | None = None
    levels: Mapping[str, float] = field(default_factory=dict)
    crossings: Sequence[tuple[str, Crossing]] = ()
    limits: tuple[float, float] | None = None


def cumulative(label: str, look: Look, values: Array) -> Line:
    """The share (%) of values (n,) up to x."""
    ordered = np.sort(values)
    shares = 100.0 * np.arange(1, len(ordered) + 1) / len(ordered)
    return Line(label, look, ordered.tolist(), [Estimate(s, np.nan, np.nan) for s in shares.tolist()], steps=True)


def paint_curves(figure: Figure, rows: Sequence[Sequence[Panel]], shared: bool = True) -> None:
    """Panels by row, one legend above all of them. shared: panels of a column (of the only row) share their scale."""
    share: Literal["row", "col", "none"] = ("row" if len(rows) == 1 else "col") if shared else "none"
    axes = figure.subplots(len(rows), len(rows[0]), squeeze=False, sharey=share)
    for row, panels in zip(axes, rows, strict=True):
        for ax, panel in zip(row, panels, strict=True):
            _paint(ax, panel)
    columns = list(zip(*rows, strict=True))
    for column, panels in zip(axes.T, columns, strict=True):
        for ax, panel in zip(column, panels, strict=True):
            _limit(ax, [panel] if not shared else panels if len(rows) > 1 else rows[0])
    for row, panels in zip(axes, rows, strict=True):
        for ax, panel in zip(row, panels, strict=True):
            _mark_cut(ax, panel.lines)
    named = {n: handle for ax in axes.flat for handle, n in zip(*ax.get_legend_handles_labels(), strict=True)}
    outside_legend(figure, named.values(), named, side="above", ncols=min(len(named), 4), handlelength=2.6)


def _paint(ax: Axes, panel: Panel) -> None:
    grid(ax)
    ax.set_xscale("log")
    ax.set_xticks(list(panel.ticks), [f"{tick:g}" for tick in panel.ticks])
    ax.set_xticks([], minor=True)
    if panel.ratio:
        ax.set_yscale("log")
        ax.set_yticks(TICKS, [f"{tick:g}" for tick in TICKS])
        ax.set_yticks([], minor=True)
    if panel.shaded is not None:
        ax.axvspan(*panel.shaded, color="0.88", linewidth=0.0, zorder=0)
    for (name, level), dashes in zip(panel.levels.items(), ("--", ":"), strict=False):
        ax.axhline(level, color="0.2", linewidth=0.9, linestyle=dashes, label=name)
    for line in panel.lines:
        _paint_line(ax, line)
    for k, (colour, where) in enumerate(panel.crossings):
        _paint_crossing(ax, colour, where, 0.035 + 0.045 * k)
    ax.set(title=panel.title, xlabel=panel.across, ylabel=panel.up)


def _paint_line(ax: Axes, line: Line) -> None:
    colour, dashes, marker = line.look
    values = [point.value for point in line.points]
    if line.thin:
        ax.plot(line.x, values, color=colour, linestyle=dashes, linewidth=0.6, alpha=0.55)
        return
    if line.steps:
        ax.step(line.x, values, where="post", color=colour, linestyle=dashes, linewidth=1.6, label=line.label)
        return
    low, high = ([getattr(point, end) for point in line.points] for end in ("low", "high"))
    if line.banded:
        ax.fill_between(line.x, low, high, color=colour, alpha=0.15, linewidth=0.0)
    else:
        ax.vlines(line.x, low, high, color=colour, linewidth=1.0, alpha=0.7)
    ax.plot(
        line.x, values, color=colour, linestyle=dashes, linewidth=1.7, marker=marker, markersize=4, label=line.label
    )


def _paint_crossing(ax: Axes, colour: str, where: Crossing, height: float) -> None:
    """Draw the interval of a crossing at the foot of the axes."""
    ends = np.clip([where.low, where.high], where.first, where.last)
    foot = ax.get_xaxis_transform()
    ax.plot(ends, [height] * 2, color=colour, linewidth=3.0, alpha=0.6, transform=foot, solid_capstyle="butt")
    place, mark = (where.value, "v") if np.isfinite(where.value) else (where.last, ">")
    ax.plot([place], [height], mark, color=colour, markersize=6, transform=foot, clip_on=False)


def _limit(ax: Axes, panels: Sequence[Panel]) -> None:
    """Limit the axis to about the range of the values, so that a wide band does not flatten the rest."""
    first, lines = panels[0], [line for panel in panels for line in panel.lines]
    values = np.array([p.value for line in lines for p in line.points if np.isfinite(p.value)])
    if first.limits is not None:
        ax.set_ylim(*first.limits)
    if not values.size or first.limits is not None:
        return
    lows = [p.low for line in lines for p in line.points if not line.thin and np.isfinite(p.low)]
    least = min(lows, default=values.min())
    if first.ratio:
        ax.set_ylim(np.clip(least, values.min() / 2.0, values.min()) / 1.2, min(values.max(), MOST_NMSE) * 1.25)
    else:
        ax.set_ylim(
            np.clip(least, values.min() - 2.0, values.min()) - 0.4, min(values.max() + 0.6, values.min() + MOST_NLPD)
        )


def _mark_cut(ax: Axes, lines: Sequence[Line]) -> None:
    """Draw a triangle at the top where a thick line leaves the axes."""
    top, foot = ax.get_ylim()[1], ax.get_xaxis_transform()
    for k, line in enumerate(line for line in lines if not line.thin):
        cut = [x for x, point in zip(line.x, line.points, strict=True) if point.value > top]
        if cut:
            place = [1.0 - 0.045 * k] * len(cut)  # stacked, if several leave at one place
            ax.plot(cut, place, "^", color=line.look[0], markersize=5.0, transform=foot, clip_on=False)
