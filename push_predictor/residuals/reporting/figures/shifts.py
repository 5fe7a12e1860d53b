"""The shift of dx, dy, dtheta by an effect: found against fitted, and against push angle or push direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.report.maps import arc_length, commonest_condition, sector_length
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.geometry.outline import Outline
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint
from push_predictor.models.mechanisms import Push
from push_predictor.reporting.canvas import COLOURS, PREDICTED, SYMBOLS, UNIT_NAMES, UNITS, grid
from push_predictor.residuals.evidence.standardised import mechanics_under
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.partial import CENTRAL, DRAWS, LEAST_PUSHES, Rows, shift_of
from push_predictor.types import Array, BoolArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHIFT_BINS = 8
COURSE_BINS = 9
PLACES = ("first third", "middle third", "last third")


@dataclass(frozen=True, eq=False)
class Course:
    """Position x (n,) of windows on an axis with its label, and named groups of windows as masks (n,)."""

    x: Array
    label: str
    groups: tuple[tuple[str, BoolArray], ...]


@dataclass(frozen=True, eq=False)
class Means:
    """Bins (b,): position, mean fitted shift with half its 95 % band, mean shift found with its 95 % ends."""

    place: Array
    fitted: Array
    half: Array
    found: Array
    low: Array
    high: Array


def paint_shifts(figure: Figure, trace: Trace, effect: Effect, analysis: Rows, held_out: Rows | None) -> None:
    """Paint the mean shift found against the fitted shift, per output; a correct effect lies on the diagonal."""
    axes = figure.subplots(1, 3)
    for k, ax in enumerate(axes):
        _paint_shift(ax, trace, effect, (analysis, held_out), k)
    axes[0].set_ylabel("Observed shift")
    axes[0].legend(loc="upper left", handlelength=1.2)


def paint_course(figure: Figure, trace: Trace, effect: Effect, rows: Rows, course: Course) -> None:
    """Paint the shift of each output along an axis: lines fitted, points found."""
    axes = figure.subplots(1, 3)
    for k, ax in enumerate(axes):
        grid(ax)
        ax.axhline(0.0, color="0.2", linewidth=0.8, linestyle=":")
        for (name, group), colour in zip(course.groups, COLOURS, strict=False):
            _paint_group(ax, binned_means(trace, effect, rows, course.x, group, k), colour, name)
        ax.set_title(f"Shift of {SYMBOLS[k]} ({UNIT_NAMES[k]})")
    axes[0].legend(loc="best", handlelength=1.2)
    axes[1].set_xlabel(course.label)


def course_of(effect: Effect, outline: Outline, rows: Rows) -> Course:
    """The push direction for effects that are fixed to the world, else the push angle by thirds of the edge.

    Only windows of the commonest speed and duration: a shift grows with the distance travelled.
    """
    table, alike = rows.table, commonest_condition(rows.table).rows
    if "push_heading" in table.covariates and (effect.covariate == "push_heading" or "slider_heading" in effect.needs):
        return Course(
            np.degrees(table.covariates["push_heading"]), "Push direction in the world (deg)", (("all pushes", alike),)
        )
    third = np.minimum((arc_length(outline, table.inputs[:, 1]) / sector_length(outline) * 3.0).astype(int), 2)
    groups = tuple((name, alike & (third == k)) for k, name in enumerate(PLACES))
    return Course(np.degrees(table.inputs[:, 2]), "Push angle (deg)", groups)


def binned_means(
    trace: Trace, effect: Effect, rows: Rows, x: Array, group: BoolArray, output: int, bins: int = COURSE_BINS
) -> Means:
    """Means of an output's shift (shown units) in bins of x (n,) with equal counts of the group's windows."""
    design = _design(trace, effect, rows)[:, output] * UNITS[output]
    fitted = shift_of(trace, effect, rows.table)[:, output] * UNITS[output]
    found = fitted + _residual(rows)[:, output] * UNITS[output]
    edges = np.unique(np.quantile(x[group], np.linspace(0.0, 1.0, bins + 1)[1:-1])) if group.any() else np.empty(0)
    number = np.where(group, np.searchsorted(edges, x, side="right"), -1)
    each = []
    for b in np.unique(number[number >= 0]):
        inside = number == b
        if len(set(rows.table.push_id[inside].tolist())) < LEAST_PUSHES:
            continue
        mean = design[inside].mean(axis=0)
        weights = push_bootstrap(rows.table.push_id[inside], draws=DRAWS)
        low, high = np.quantile(weights @ found[inside] / weights.sum(axis=1), [0.025, 0.975])
        half = CENTRAL * np.sqrt(max(float(mean @ effect.covariance @ mean), 0.0))
        each.append([x[inside].mean(), fitted[inside].mean(), half, found[inside].mean(), low, high])
    return Means(*np.array(each).reshape(-1, 6).T)


def _paint_group(ax: Axes, means: Means, colour: str, name: str) -> None:
    ax.fill_between(means.place, means.fitted - means.half, means.fitted + means.half, color=colour, alpha=0.2, lw=0.0)
    ax.plot(means.place, means.fitted, color=colour, linewidth=1.5, label=name)
    _bars(ax, means, colour, "o")


def _paint_shift(ax: Axes, trace: Trace, effect: Effect, parts: Sequence[Rows | None], k: int) -> None:
    grid(ax)
    ends = []
    looks = (("#D55E00", "o", "analysis pushes"), ("#3b3b3b", "s", "held-out pushes"))
    for rows, (colour, marker, name) in zip(parts, looks, strict=True):
        if rows is None:
            continue
        fitted = shift_of(trace, effect, rows.table)[:, k] * UNITS[k]
        everything = np.ones(len(fitted), dtype=np.bool_)
        means = binned_means(trace, effect, rows, fitted, everything, k, SHIFT_BINS)
        _bars(ax, means, colour, marker, name)
        ends += [*means.place.tolist()]
    if ends:
        ax.plot([min(ends), max(ends)], [min(ends), max(ends)], color=PREDICTED, linewidth=1.4)
    ax.set_title(f"Shift of {SYMBOLS[k]} ({UNIT_NAMES[k]})")
    ax.set_xlabel("Fitted shift")


def _bars(ax: Axes, means: Means, colour: str, marker: str, name: str | None = None) -> None:
    ends = np.abs(np.stack([means.found - means.low, means.high - means.found]))
    face = "white" if marker == "s" else colour
    ax.errorbar(means.place, means.found, ends, fmt=marker, color=colour, mfc=face, markersize=4.5, elinewidth=1.1,
                capsize=2.0, label=name, zorder=3)  # fmt: skip


def _design(trace: Trace, effect: Effect, rows: Rows) -> Array:
    push = Push(rows.table.inputs, rows.table.duration, rows.table.covariates)
    return joint(mechanics_under(trace.model), [effect], push).designs[0]


def _residual(rows: Rows) -> Array:
    """Residuals (n, 3) after all effects: m, m, rad."""
    return np.asarray(np.linalg.solve(rows.whitener, rows.unexplained[:, :, None])[:, :, 0])
