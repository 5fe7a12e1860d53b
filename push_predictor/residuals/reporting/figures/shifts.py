# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The shift of dx, dy, dtheta by an effect: found against fitted, and against push angle or push direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.report.maps import arc_length, commonest_condition, sector_length
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.geometry.outline import Outline
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint
from push_predictor.models.pushes import Push
from push_predictor.recordings.table import OUTPUTS
from push_predictor.reporting.canvas import UNIT_NAMES, UNITS
from push_predictor.reporting.chart import SMALL, Band, Bars, Chart, Line, limits_of
from push_predictor.residuals.evidence.standardised import mechanics_under
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.partial import CENTRAL, DRAWS, LEAST_PUSHES, Rows
from push_predictor.residuals.reporting.phrases import interval
from push_predictor.types import Array, BoolArray

SHIFT_BINS = 8
COURSE_BINS = 9
PLACES = ("first third", "middle third", "last third")
KINDS = ("fit", "dy", "dtheta")  # colours of the thirds


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


@dataclass(frozen=True, eq=False)
class Shifts:
    """An effect's fitted shift (n, 3), and the shift found (n, 3), mm and deg; design (n, 3, p) of its coefficients.

    covariance (p, p): of the coefficients.
    """

    rows: Rows
    fitted: Array
    found: Array
    design: Array
    covariance: Array


def shifts_of(trace: Trace, effect: Effect, rows: Rows) -> Shifts:
    """The shifts of the windows by an effect."""
    push = Push(rows.table.inputs, rows.table.duration, rows.table.covariates)
    together = joint(mechanics_under(trace.model), [effect], push)
    fitted = together.shift * UNITS
    residual = np.linalg.solve(rows.whitener, rows.unexplained[:, :, None])[:, :, 0] * UNITS
    design = together.designs[0] * np.array(UNITS)[:, None]
    return Shifts(rows, fitted, fitted + residual, design, effect.covariance)


def shift_charts(analysis: Shifts, held_out: Shifts | None) -> list[Chart]:
    """The mean shift found against the fitted shift, per output; a correct effect lies on the diagonal."""
    return [_shift_chart((analysis, held_out), k) for k in range(len(OUTPUTS))]


def course_charts(shifts: Shifts, course: Course) -> list[Chart]:
    """The shift of each output along an axis: lines fitted, points found."""
    return [_course_chart(shifts, course, k) for k in range(len(OUTPUTS))]


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


def binned_means(shifts: Shifts, x: Array, group: BoolArray, output: int, bins: int = COURSE_BINS) -> Means:
    """Means of an output's shift (shown units) in bins of x (n,) with equal counts of the group's windows."""
    push_id = shifts.rows.table.push_id
    fitted, found, design = shifts.fitted[:, output], shifts.found[:, output], shifts.design[:, output]
    edges = np.unique(np.quantile(x[group], np.linspace(0.0, 1.0, bins + 1)[1:-1])) if group.any() else np.empty(0)
    number = np.where(group, np.searchsorted(edges, x, side="right"), -1)
    each = []
    for b in np.unique(number[number >= 0]):
        inside = number == b
        if len(set(push_id[inside].tolist())) < LEAST_PUSHES:
            continue
        mean = design[inside].mean(axis=0)
        weights = push_bootstrap(push_id[inside], draws=DRAWS)
        low, high = np.quantile(weights @ found[inside] / weights.sum(axis=1), [0.025, 0.975])
        half = CENTRAL * np.sqrt(max(float(mean @ shifts.covariance @ mean), 0.0))
        each.append([x[inside].mean(), fitted[inside].mean(), half, found[inside].mean(), low, high])
    return Means(*np.array(each).reshape(-1, 6).T)


def _course_chart(shifts: Shifts, course: Course, k: int) -> Chart:
    means = [binned_means(shifts, course.x, group, k) for _, group in course.groups]
    x = limits_of(course.x, margin=0.02)
    y = limits_of(np.zeros(1), *(each for m in means for each in (m.low, m.high, m.fitted - m.half, m.fitted + m.half)))
    fits = (
        (Band(kind, m.place, m.fitted - m.half, m.fitted + m.half), Line(kind, m.place, m.fitted, name=name))
        for m, kind, (name, _) in zip(means, KINDS, course.groups, strict=False)
    )
    found = tuple(_bars(m, kind, UNIT_NAMES[k]) for m, kind in zip(means, KINDS, strict=False))
    marks = Line("zero", np.array(x), np.zeros(2)), *(mark for fit in fits for mark in fit), *found
    return Chart(f"{_title(k)} against {course.label}.", course.label, _title(k), x, y, marks, size=SMALL)


def _shift_chart(parts: Sequence[Shifts | None], k: int) -> Chart:
    looks = ("before", "analysis pushes"), ("held", "held-out pushes")
    found: list[Bars] = []
    for shifts, (kind, name) in zip(parts, looks, strict=True):
        if shifts is not None:
            fitted = shifts.fitted[:, k]
            means = binned_means(shifts, fitted, np.ones(len(fitted), dtype=np.bool_), k, SHIFT_BINS)
            found.append(_bars(means, kind, UNIT_NAMES[k], name))
    x = limits_of(np.zeros(1), *(bars.x for bars in found))
    y = limits_of(np.array(x), *(end for bars in found for end in (bars.low, bars.high)))
    marks = Line("fit", np.array(x), np.array(x), name="as fitted"), *found
    return Chart(f"{_title(k)}, observed against fitted.", "Fitted shift", _title(k), x, y, marks, size=SMALL)


def _title(k: int) -> str:
    return f"Shift of {OUTPUTS[k]} ({UNIT_NAMES[k]})"


def _bars(means: Means, kind: str, unit: str, name: str = "") -> Bars:
    ends = zip(means.found, means.low, means.high, strict=True)
    titles = [interval(Estimate(float(value), float(low), float(high)), unit) for value, low, high in ends]
    return Bars(kind, means.place, means.found, means.low, means.high, titles, name=name)
