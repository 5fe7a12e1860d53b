# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes along an axis: the force, the gap at the contact, the inputs, and errors before and after.

The axis is a covariate, or the time if there is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.push_scores import push_means, resampled_means
from push_predictor.evaluation.validation import Comparison
from push_predictor.recordings.table import INPUTS, OUTPUTS, PushTable
from push_predictor.reporting.canvas import UNITS
from push_predictor.reporting.chart import HALF, SMALL, Band, Bars, Chart, Columns, Dots, Line, Mark, limits_of
from push_predictor.reporting.html import number
from push_predictor.residuals.channels.measurement import NEEDED, gap_responses
from push_predictor.residuals.channels.sensor_zero import WRENCH_BIAS
from push_predictor.residuals.evidence.drivers import at_touch
from push_predictor.residuals.evidence.standardised import push_order
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.phrases import bare, capitalised, covariate_phrase, interval, shown_unit_of
from push_predictor.types import Array, IntArray, TextArray

SHARE = 0.02  # of the windows at either end that the limits may cut off
HISTOGRAM = 16  # bars
MODELS = {"before": "before", "refit": "push", "after": "after"}  # the mark of each
LEAST_PUSHES = 3  # of a bin that is shown
BINS, PUSHES_PER_BIN = 10, 4  # at most; about
GAP, WIDTH = 0.05, 0.03  # of the range: levels of a covariate are farther apart, and narrower


@dataclass(frozen=True, eq=False)
class Values:
    """Values y (n,) of windows of these pushes along an axis."""

    axis: Axis
    push_id: TextArray
    y: Array


def force_chart(trace: Trace) -> Chart | None:
    """The force now and in training, along what it depends on; None without a force."""
    now, before = (_force(table, trace.effects[0].covariate) for table in (trace.analysis, trace.model.training))
    return None if now is None else _compared("Normal force (N)", "N", now, before)


def gap_chart(trace: Trace) -> Chart | None:
    """The gap that a measurement error opens, and the gap as fitted; None if the windows do not contain it."""
    effects, table = trace.effects, trace.analysis
    if effects[0].mechanism == WRENCH_BIAS or not {*NEEDED} <= {*table.covariates}:
        return None
    name = str(effects[0].mechanism)
    sizes = np.array([e.parameter.value for e in effects if e.mechanism == name and e.parameter is not None])
    shown = table.take(at_touch(table) == 0.0)
    fitted = 1e3 * gap_responses(shown, trace.model.rig.outline)[name] @ sizes
    axis = Axis(fitted, "Gap that the error causes, as fitted (mm)", {})
    gap = Values(axis, shown.push_id, 1e3 * shown.covariates["contact_gap"])
    chart = _compared("Measured gap at the contact (mm)", "mm", gap, None)
    ends = np.array([fitted.min(), fitted.max()])
    line = Line("fit", ends, ends, name="as the error predicts")
    zero = Line("zero", np.array(chart.x), np.zeros(2))
    return replace(chart, marks=(zero, *chart.marks, line), y=limits_of(np.array(chart.y), fitted, np.zeros(1)))


def size_chart(trace: Trace) -> Chart | None:
    """Root mean square error of each push over the predicted one, before and after; 1 is as predicted.

    Of the outputs that the first effect is about, along its covariate.
    """
    covariate, names = (trace.effects[0].covariate, trace.effects[0].outputs) if trace.effects else ("", OUTPUTS)
    outputs = [OUTPUTS.index(name) for name in names or OUTPUTS]
    table, shown = trace.analysis, [("before", trace.residual)]
    if trace.terms and not np.array_equal(trace.residual, trace.unexplained):
        shown.append(("after", trace.unexplained))
    if any(len(z) != len(table) for _, z in shown):
        return None
    axis, alone = axis_of(table, covariate), len(shown) == 1
    sizes = [Values(axis, table.push_id, np.sqrt(np.mean(z[:, outputs] ** 2, axis=1))) for _, z in shown]
    kinds = ["push"] if alone else [kind for kind, _ in shown]
    dots, bars, top = _sizes(sizes, kinds, "", ["pushes, in bins"] if alone else kinds, "one push" if alone else "")
    label = "Error of a push / predicted standard deviation"
    x, y = limits_of(axis.x, margin=0.02), (0.0, 1.1 * max(top, 1.5))
    marks = (Line("held", np.array(x), np.ones(2), name="as predicted"), *dots, *bars)
    return Chart(f"{label}.", axis.label, label, x, y, marks, names=axis.names)


def input_chart(trace: Trace, covariate: str) -> Chart | None:
    """Histograms of a covariate in training and now; None if either lacks it."""
    before, now = (recorded_axis(table, covariate) for table in (trace.model.training, trace.analysis))
    if before is None or now is None:
        return None
    edges = np.linspace(*limits_of(now.x, before.x, margin=0.02), HISTOGRAM + 1)
    shares = [100.0 * np.histogram(each.x, edges)[0] / len(each.x) for each in (before, now)]
    marks = Columns("push", edges, shares[0], name="training"), Columns("before", edges, shares[1], name="now")
    ends = (float(edges[0]), float(edges[-1])), (0.0, 1.1 * float(np.max(shares)))
    return Chart(f"{now.label} in training and now.", now.label, "% of windows", *ends, marks, size=SMALL)


def error_charts(table: PushTable, covariate: str, shown: Sequence[Comparison]) -> list[Chart]:
    """Error of the position (mm) and of the heading (deg) of each push under each model, along the covariate.

    A model may have been judged on other windows of the same pushes.
    """
    axis = axis_of(table, covariate)
    place = dict(zip(*push_means(table.push_id, axis.x), strict=True))
    return [
        _error_chart(axis, [_error(c, place, axis, k) for c in shown], [MODELS[c.model] for c in shown], *each)
        for k, each in enumerate((("Position error of a push (mm)", "mm"), ("Heading error of a push (deg)", "deg")))
    ]


def _error(comparison: Comparison, place: dict[str, float], axis: Axis, k: int) -> Values:
    """Error of the position (k = 0) or of the heading in each window of known pushes, in shown units."""
    known = np.array([push in place for push in comparison.push_id.tolist()], dtype=np.bool_)
    push_id, error = comparison.push_id[known], ((comparison.observed - comparison.mean) * UNITS)[known]
    x = np.array([place[push] for push in push_id.tolist()])
    return Values(replace(axis, x=x), push_id, np.abs(error[:, 2]) if k else np.hypot(error[:, 0], error[:, 1]))


def _error_chart(axis: Axis, errors: Sequence[Values], kinds: Sequence[str], label: str, unit: str) -> Chart:
    dots, bars, top = _sizes(errors, kinds, unit, kinds)
    x, y = limits_of(axis.x, margin=0.02), (0.0, limits_of(np.array([0.0, top]))[1])
    return Chart(f"{label} before and after.", axis.label, label, x, y, (*dots, *bars), size=HALF, names=axis.names)


def _sizes(
    every: Sequence[Values], kinds: Sequence[str], unit: str, names: Sequence[str], one: str = ""
) -> tuple[list[Dots], list[Bars], float]:
    """Root mean square of each push, and in bins with their intervals; and the largest value to be shown."""
    each = zip(every, kinds, names, strict=True)
    pairs = [_pushes(values, (kind, kind), unit, (one, name), square=True) for values, kind, name in each]
    dots, bars = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    tops = [bar.high.max(initial=0.0) for bar in bars]
    tops += [np.quantile(dot.y, 1.0 - SHARE) for dot in dots if len(dot.y)]
    return dots, bars, float(max(tops, default=0.0))


def _pushes(
    values: Values, kinds: tuple[str, str], unit: str, names: tuple[str, str], *, square: bool = False
) -> tuple[Dots, Bars]:
    """Means of each push, and in bins with their intervals; square: root mean squares instead."""
    pushes, y = push_means(values.push_id, values.y**2 if square else values.y)
    y = np.sqrt(y) if square else y
    bins = means_along(values.axis, values.push_id, values.y, square=square)
    place = push_means(values.push_id, values.axis.x)[1]
    return Dots(kinds[0], place, y, titles(pushes, y, unit), name=names[0]), bins.bars(kinds[1], unit, names[1])


def _force(table: PushTable, covariate: str) -> Values | None:
    force = table.covariates.get("normal_force")
    return None if force is None or not len(table) else Values(axis_of(table, covariate), table.push_id, force)


def _compared(label: str, unit: str, now: Values, before: Values | None) -> Chart:
    """Pushes and bins along the axis now, and in training: along the same axis, or its range if time is the axis."""
    kinds = "push" if before is None else "before", "before"
    dots, bars = _pushes(now, kinds, unit, ("one push", "pushes, in bins"))
    x = limits_of(now.axis.x, margin=0.02)
    known = [] if before is None else [np.quantile(before.y, [0.05, 0.95])]
    y = limits_of(np.quantile(dots.y, [SHARE, 1.0 - SHARE]), bars.low, bars.high, *known)
    marks = (*(() if before is None else _training(before, x)), dots, bars)
    return Chart(f"{label}.", now.axis.label, label, x, y, marks, names=now.axis.names)


def _training(before: Values, x: tuple[float, float]) -> tuple[Mark, ...]:
    low, middle, high = np.quantile(before.y, [0.05, 0.5, 0.95])
    ends = np.array(x)
    band = Band("push", ends, np.full(2, low), np.full(2, high), name="middle 90 % of the training windows")
    return band, Line("push", ends, np.full(2, middle), name="median in training")


# --- axes, means and bins ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Axis:
    """Position (n,) of each window, in shown units, with the label of the axis and names of places if it has any.

    factor: from the covariate's unit to the shown one.
    """

    x: Array
    label: str
    names: dict[float, str]
    factor: float = 1.0

    @property
    def whole(self) -> bool:
        """Whether the positions are a few named places."""
        return bool(self.names)


@dataclass(frozen=True, eq=False)
class Bins:
    """Places (b,) of bins along an axis; in each an estimate (b, ...) with 95 % ends from a bootstrap of pushes."""

    place: Array
    value: Array
    low: Array
    high: Array

    def bars(self, kind: str, unit: str, name: str) -> Bars:
        """The mark that shows one estimate for each bin; hovering shows it with its unit."""
        ends = zip(self.value, self.low, self.high, strict=True)
        shown = [interval(Estimate(*map(float, each)), unit) for each in ends]
        return Bars(kind, self.place, self.value, self.low, self.high, shown, name=name)


def axis_of(table: PushTable, covariate: str) -> Axis:
    """The covariate, or the time (else the push count) if it is not recorded or does not vary."""
    axis = recorded_axis(table, covariate)
    if axis is not None and np.ptp(axis.x) > 0.0:
        return axis
    return _order(table) if covariate == "elapsed_time" else axis_of(table, "elapsed_time")


def recorded_axis(table: PushTable, covariate: str) -> Axis | None:
    """A covariate or an input; None if there are no windows, or if they do not contain it."""
    values = table.inputs[:, INPUTS.index(covariate)] if covariate in INPUTS else table.covariates.get(covariate)
    if values is None or not len(values):
        return None
    names = {float(v): f"{v:g}" for v in np.unique(values)} if covariate in ("edge", "recording") else {}
    factor, unit = shown_unit_of(covariate)
    name = capitalised(bare(covariate_phrase(covariate)))
    return Axis(factor * values, f"{name} ({unit})" if unit else name, names, factor)


def titles(names: Sequence[str], values: Array, unit: str = "") -> list[str]:
    """What hovering over each push shows."""
    return [f"push {name}: {number(float(v), 3)} {unit}".rstrip() for name, v in zip(names, values, strict=True)]


def bins_along(values: Array, count: int) -> IntArray:
    """Bin (n,) of each value: the levels of a covariate that has few, else equal counts."""
    ordered = np.sort(values)
    reach = float(np.ptp(ordered)) if len(ordered) else 0.0
    ends = np.flatnonzero(np.diff(ordered) > GAP * reach) + 1
    levels = np.split(ordered, ends)
    if len(levels) > 1 and max(float(np.ptp(level)) for level in levels) <= WIDTH * reach:
        edges = 0.5 * (ordered[ends - 1] + ordered[ends])
    else:
        edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, count + 1)[1:-1])) if reach else np.empty(0)
    return np.asarray(np.searchsorted(edges, values, side="right"), dtype=np.int64)


def means_along(axis: Axis, push_id: TextArray, values: Array, *, square: bool = False) -> Bins:
    """Means of values (n,) in bins of the axis; square: root mean squares instead."""
    count = int(np.clip(len(set(push_id.tolist())) // PUSHES_PER_BIN, 1, BINS))
    bins = np.unique(axis.x, return_inverse=True)[1] if axis.whole else bins_along(axis.x, count)
    found = [_mean(axis.x, push_id, values, bins == b, square) for b in np.unique(bins)]
    return Bins(*np.array([each for each in found if each is not None]).reshape(-1, 4).T)


def _mean(x: Array, push_id: TextArray, values: Array, rows: Array, square: bool) -> list[float] | None:
    if len(set(push_id[rows].tolist())) < LEAST_PUSHES:
        return None
    shown = values[rows] ** 2 if square else values[rows]
    low, high = np.quantile(resampled_means(push_id[rows], shown[:, None]), [0.025, 0.975])
    ends = np.array([shown.mean(), low, high])
    return [float(x[rows].mean()), *(np.sqrt(ends) if square else ends).tolist()]


def _order(table: PushTable) -> Axis:
    return Axis(push_order(table).astype(np.float64), "Push count", {})
