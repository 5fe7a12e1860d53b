# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""An effect as fitted against its covariate, with its band, and the data that it rests on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.chart import HALF, WIDE, Band, Bars, Cells, Chart, Dots, Line, Mark, limits_of
from push_predictor.reporting.html import number
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.partial import Binned, Rows, Strength, binned, per_push, responses
from push_predictor.residuals.reporting.figures.pushes import Axis, axis_of, bins_along, push_means, titles
from push_predictor.residuals.reporting.phrases import capitalised, interval, shown_unit, with_unit
from push_predictor.types import Array, BoolArray, IntArray

GRID = 400
PUSHES_PER_BIN = 12
FEWEST_BINS, MOST_BINS = 3, 12
MAP_CELLS = 16
ASIDE = 0.08  # offset of the points of a category's levels, to either side
WIDEST = 8.0  # median widths of an interval that is shown; a bin of pushes that all stick has a far wider one
ROOM = 0.35  # of the range of curve and bins, above and below them
PERIODIC = ("periodic", "periodic, twice around")


@dataclass(frozen=True, eq=False)
class Seen:
    """Rows along an axis: names, positions (k,) and parameters (k, q) of the pushes, and the bins."""

    axis: Axis
    names: list[str]
    place: Array
    value: Array
    bins: Binned


def basis_charts(trace: Trace, strength: Strength, analysis: Rows, held_out: Rows | None) -> list[Chart]:
    """A chart for each parameter of the effect: the fit, single pushes and bins, along its covariate or the time."""
    every = range(len(strength.names))
    if len(strength.effect.basis.drivers) > 1:
        return [_map_chart(trace, strength, analysis, q) for q in every]
    seen = _seen(trace, strength, analysis)
    later = None if held_out is None else _seen(trace, strength, held_out)
    return [_chart(strength, analysis.table, seen, later, q) for q in every]


def bins_of(basis: DriverBasis, table: PushTable) -> IntArray:
    """Bin (n,) of each window: levels, equal widths of a heading, else equal counts."""
    count = int(np.clip(len(table.pushes) // PUSHES_PER_BIN, FEWEST_BINS, MOST_BINS))
    if basis.name == "category":
        return np.asarray(np.searchsorted(np.sort(basis.levels), table.covariates[basis.drivers[0]]), dtype=np.int64)
    if basis.name in PERIODIC:
        values = table.covariates[basis.drivers[0]]
        return np.asarray(np.clip((values + np.pi) / (2.0 * np.pi) * count, 0, count - 1), dtype=np.int64)
    return bins_along(_axis(basis, table).x, count)


def parameter_label(strength: Strength, q: int) -> str:
    """A parameter with its unit, for an axis."""
    _, unit = shown_unit(strength.units[q])
    name = capitalised(strength.names[q])
    return f"{name} ({unit})" if unit else name


def _seen(trace: Trace, strength: Strength, rows: Rows) -> Seen:
    axis, response = _axis(strength.effect.basis, rows.table), responses(trace, strength, rows)
    place, value = per_push(strength, rows, response, axis.x)
    names = push_means(rows.table.push_id, axis.x)[0]
    bins = binned(strength, rows, response, axis.x, bins_of(strength.effect.basis, rows.table))
    return Seen(axis, names, place, value, bins)


def _axis(basis: DriverBasis, table: PushTable) -> Axis:
    return axis_of(table, basis.drivers[0] if basis.drivers else "")


def _chart(strength: Strength, table: PushTable, seen: Seen, later: Seen | None, q: int) -> Chart:
    factor, unit = shown_unit(strength.units[q])
    fit, limits = _fit(strength, table, seen.axis, q, factor)
    aside = ASIDE if strength.effect.basis.name == "category" else 0.0
    single = factor * seen.value[:, q]
    bars = _bars("before", "analysis pushes, in bins", seen.bins, q, factor, unit, -aside)
    held = [_bars("held", "held-out pushes, in bins", later.bins, q, factor, unit, aside)] if later else []
    low, high = limits_of(*limits, bars.low, bars.high, np.zeros(1), margin=ROOM)
    x = limits_of(seen.axis.x, margin=0.3 if seen.axis.whole else 0.02)
    zero = Line("zero", np.array(x), np.zeros(2))
    dots = Dots("push", seen.place, single, titles(seen.names, single, unit), name="one push")
    label = parameter_label(strength, q)
    marks = (zero, *fit, dots, bars, *held)
    return Chart(
        f"{label}, fitted and measured.", seen.axis.label, label, x, (low, high), marks, names=seen.axis.names,
        size=WIDE if len(strength.names) == 1 else HALF,
    )  # fmt: skip


def _fit(strength: Strength, table: PushTable, axis: Axis, q: int, factor: float) -> tuple[list[Mark], list[Array]]:
    """The fitted curve with its band, and their values."""
    basis = strength.effect.basis
    if basis.name == "category":
        points = np.array(basis.levels)
    elif basis.name in PERIODIC:
        points = np.linspace(-np.pi, np.pi, GRID)
    else:
        values = table.covariates[basis.drivers[0]] if basis.drivers else np.zeros(1)
        points = np.linspace(values.min(), values.max(), GRID)
    mean, half = (factor * each[:, q] for each in strength.curve(dict.fromkeys(basis.drivers, points), len(points)))
    varies = np.ptp(points) > 0.0  # else along the time
    x = axis.factor * points if varies else np.linspace(axis.x.min(), axis.x.max(), GRID)
    name = "fitted, with 95 % interval"
    if basis.name == "category":
        shown = [f"fitted: {number(float(value), 3)}" for value in mean]
        return [Bars("after", x, mean, mean - half, mean + half, shown, name=name)], [mean - half, mean + half]
    return [Band("fit", x, mean - half, mean + half), Line("fit", x, mean, name=name)], [mean - half, mean + half]


def determined(width: Array) -> BoolArray:
    """Bins that determine the parameter: their interval is not far wider than most."""
    return np.asarray(width <= WIDEST * np.median(width)) if len(width) else np.zeros(0, dtype=np.bool_)


def _bars(kind: str, name: str, bins: Binned, q: int, factor: float, unit: str, aside: float) -> Bars:
    kept = determined(bins.high[:, q] - bins.low[:, q])
    value, low, high = (factor * each[kept, q] for each in (bins.value, bins.low, bins.high))
    each = [interval(Estimate(*map(float, ends)), unit) for ends in zip(value, low, high, strict=True)]
    return Bars(kind, bins.place[kept] + aside, value, low, high, each, name=name)


def _map_chart(trace: Trace, strength: Strength, rows: Rows, q: int) -> Chart:
    """The fitted map, and on it each push in the colour of its own estimate."""
    factor, unit = shown_unit(strength.units[q])
    x, y = (rows.table.covariates[name] for name in strength.effect.basis.drivers)
    edges = [np.linspace(v.min(), v.max(), MAP_CELLS + 1) for v in (x, y)]
    gx, gy = np.meshgrid(*(0.5 * (e[1:] + e[:-1]) for e in edges))
    grid = dict(zip(strength.effect.basis.drivers, (gx.ravel(), gy.ravel()), strict=True))
    fitted = factor * strength.curve(grid, gx.size)[0][:, q].reshape(gx.shape)
    reach = max(float(np.abs(fitted).max()), 1e-12)
    shown = [[f"fitted: {number(float(value), 3)} {unit}".rstrip() for value in line] for line in fitted]
    names, place = push_means(rows.table.push_id, x)
    single = factor * per_push(strength, rows, responses(trace, strength, rows), x)[1][:, q]
    known = np.isfinite(single)
    kept = [name for name, is_known in zip(names, known, strict=True) if is_known]
    dots = (place[known], push_means(rows.table.push_id, y)[1][known], titles(kept, single[known], unit))
    cells = Cells("", edges[0], edges[1], fitted / reach, shown)
    first, second = (with_unit(name) for name in strength.effect.basis.drivers)
    across, up = ((float(e[0]), float(e[-1])) for e in edges)
    key = number(-reach, 2), number(reach, 2), parameter_label(strength, q)
    marks = cells, Dots("coloured", *dots, single[known] / reach)
    return Chart(f"Map of {key[2]}.", first, second, across, up, marks, size=(WIDE[0], 1.3 * WIDE[1]), key=key)
