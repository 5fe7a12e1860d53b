# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Learning curves: scores by training size, one line per group, with bands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.reporting.canvas import COLOURS, grid, outside_legend
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.fits.crossing import Crossing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PALETTE = (*COLOURS, "#CC79A7")  # a fourth of Okabe and Ito
DASHES = ("-", "--", "-.", (0, (1, 1.2)))
MARKERS = ("o", "s", "^", "D")
KIND_LOOKS = {"analytical": ("#4d4d4d", "--", ""), "gp": ("#D55E00", "-", "s"), "vhgp": ("#0072B2", "-", "o")}
MOST_NLPD = 11.0  # nats shown above the lowest point; tiny training sets give far more
MOST_NMSE = 6.0
TICKS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)


@dataclass(frozen=True)
class Line:
    """A curve; thin ones are single members of a group, without interval and name.

    banded: its intervals are a band, else whiskers.
    """

    label: str
    look: tuple[str, object, str]  # colour, dashes, marker
    sizes: tuple[int, ...]
    points: tuple[Estimate, ...]
    thin: bool = False
    banded: bool = True


@dataclass(frozen=True)
class Panel:
    """One pair of axes; ratio: a logarithmic vertical axis; zero: a line at 0.

    crossings: colour and place, marked at the foot.
    """

    title: str
    label: str
    lines: tuple[Line, ...]
    ratio: bool = False
    zero: bool = False
    crossings: tuple[tuple[str, Crossing], ...] = ()


def look_of(number: int) -> tuple[str, object, str]:
    """Colour, dashes and marker of one of four groups."""
    return PALETTE[number], DASHES[number], MARKERS[number]


def paint_panels(figure: Figure, rows: Sequence[Sequence[Panel]]) -> None:
    """Panels by row, one legend above all of them; panels of a column share their vertical axis."""
    axes = figure.subplots(
        len(rows), len(rows[0]), squeeze=False, sharey=True if len(rows) == 1 else "col", sharex=True
    )
    for row, panels in zip(axes, rows, strict=True):
        for ax, panel in zip(row, panels, strict=True):
            _paint(ax, panel)
    for ax, panels in zip(axes.T, zip(*rows, strict=True), strict=True):
        _limit(ax[0], panels)
    for row, panels in zip(axes, rows, strict=True):
        for ax, panel in zip(row, panels, strict=True):
            _mark_cut(ax, panel.lines)
    sizes = sorted({n for panels in rows for panel in panels for line in panel.lines for n in line.sizes})
    for ax in axes[-1]:
        ax.set_xlabel("training windows n")
        ax.set_xticks(sizes, [str(n) for n in sizes])
        ax.set_xticks([], minor=True)
    handles, names = axes[0, 0].get_legend_handles_labels()
    outside_legend(figure, handles, names, side="above", ncols=max(len(names), 1), handlelength=2.6)


def _paint(ax: Axes, panel: Panel) -> None:
    grid(ax)
    ax.set_xscale("log")
    if panel.ratio:
        ax.set_yscale("log")
        ax.set_yticks(TICKS, [f"{tick:g}" for tick in TICKS])
        ax.set_yticks([], minor=True)
    if panel.zero:
        ax.axhline(0.0, color="0.2", linewidth=0.8, linestyle=":")
    for line in panel.lines:
        _paint_line(ax, line)
    for k, (colour, where) in enumerate(panel.crossings):
        _paint_crossing(ax, colour, where, 0.035 + 0.045 * k)
    ax.set_ylabel(panel.label)
    ax.set_title(panel.title)


def _paint_line(ax: Axes, line: Line) -> None:
    colour, dashes, marker = line.look
    values = [point.value for point in line.points]
    if line.thin:
        ax.plot(line.sizes, values, color=colour, linestyle=dashes, linewidth=0.6, alpha=0.55)
        return
    low, high = ([getattr(point, end) for point in line.points] for end in ("low", "high"))
    if line.banded:
        ax.fill_between(line.sizes, low, high, color=colour, alpha=0.15, linewidth=0.0)
    else:
        ax.vlines(line.sizes, low, high, color=colour, linewidth=1.0, alpha=0.7)
    ax.plot(
        line.sizes, values, color=colour, linestyle=dashes, linewidth=1.7, marker=marker, markersize=4, label=line.label
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
    lines = [line for panel in panels for line in panel.lines]
    values = np.array([p.value for line in lines for p in line.points if np.isfinite(p.value)])
    if not values.size or panels[0].zero:
        return
    lows = [p.low for line in lines for p in line.points if not line.thin and np.isfinite(p.low)]
    least = min(lows, default=values.min())
    if panels[0].ratio:
        ax.set_ylim(np.clip(least, values.min() / 2.0, values.min()) / 1.2, min(values.max(), MOST_NMSE) * 1.25)
    else:
        ax.set_ylim(
            np.clip(least, values.min() - 2.0, values.min()) - 0.4, min(values.max() + 0.6, values.min() + MOST_NLPD)
        )


def _mark_cut(ax: Axes, lines: Sequence[Line]) -> None:
    """Draw a triangle at the top where a thick line leaves the axes."""
    top, foot = ax.get_ylim()[1], ax.get_xaxis_transform()
    for k, line in enumerate(line for line in lines if not line.thin):
        cut = [n for n, point in zip(line.sizes, line.points, strict=True) if point.value > top]
        if cut:
            place = [1.0 - 0.045 * k] * len(cut)  # stacked, if several leave at one size
            ax.plot(cut, place, "^", color=line.look[0], markersize=5.0, transform=foot, clip_on=False)
