# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes along an axis: the force, the gap at the contact, the inputs, and errors before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.evaluation.validation import Comparison
from push_predictor.geometry.frames import wrap_angle
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.reporting.canvas import UNITS
from push_predictor.reporting.chart import HALF, SMALL, Band, Chart, Columns, Dots, Line, Mark, limits_of
from push_predictor.residuals.channels.measurement import gap_responses
from push_predictor.residuals.channels.sensor_zero import WRENCH_BIAS
from push_predictor.residuals.evidence.drivers import SETTLED
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.pushes import (
    Axis,
    axis_of,
    means_along,
    push_means,
    recorded_axis,
    titles,
)
from push_predictor.types import Array, TextArray

NORMAL = "Direction of the contact normal in the world (deg)"
SHARE = 0.02  # of the windows at either end that the limits may cut off
HISTOGRAM = 16  # bars
MODELS = {"before": "before", "refit": "push", "after": "after"}  # the mark of each


@dataclass(frozen=True, eq=False)
class Values:
    """Values y (n,) of windows of these pushes along an axis."""

    axis: Axis
    push_id: TextArray
    y: Array


def force_chart(trace: Trace) -> Chart | None:
    """The force now and in training, along what it depends on; None without a force."""
    effect = trace.effects[0]
    now, before = (
        _force(table, effect.covariate, effect.mechanism) for table in (trace.analysis, trace.model.training)
    )
    return None if now is None else _compared("Normal force (N)", "N", now, before)


def gap_chart(trace: Trace) -> Chart | None:
    """The gap that a measurement error opens, and the gap as fitted; None if the windows do not contain it."""
    effects, table = trace.effects, trace.analysis
    if effects[0].mechanism == WRENCH_BIAS:
        return force_chart(trace)
    if not {"contact_gap", "slider_x", "slider_y", "slider_heading"} <= set(table.covariates):
        return None
    name = str(effects[0].mechanism)
    sizes = np.array([e.parameter.value for e in effects if e.mechanism == name and e.parameter is not None])
    settled = table.covariates.get("time_since_contact", np.full(len(table), np.inf)) >= SETTLED
    shown = table.take(settled)
    response = gap_responses(shown, trace.model.rig.outline)["frame_shift" if name == "tool_offset" else name]
    fitted = 1e3 * response @ (-sizes if name == "tool_offset" else sizes)  # a tool offset is a shift of the other sign
    gap = 1e3 * shown.covariates["contact_gap"]
    x, label = fitted, "Gap that the error causes, as fitted (mm)"
    if name == "clock_offset":
        x, label = 1e3 * shown.inputs[:, 0] * np.cos(shown.inputs[:, 2]), "Speed into the contact (mm/s)"
    chart = _compared("Measured gap at the contact (mm)", "mm", Values(Axis(x, label, {}), shown.push_id, gap), None)
    ends = np.array([np.argmin(x), np.argmax(x)])
    line = Line("fit", x[ends], fitted[ends], name="as the error predicts")
    zero = Line("zero", np.array(chart.x), np.zeros(2))
    return replace(chart, marks=(zero, *chart.marks, line), y=limits_of(np.array(chart.y), fitted, np.zeros(1)))


def noise_chart(trace: Trace) -> Chart | None:
    """The size of the errors along the covariate, in units of the predicted noise."""
    outputs = [OUTPUTS.index(name) for name in trace.effects[0].outputs] if trace.effects else []
    return size_chart(trace, trace.effects[0].covariate if trace.effects else "", outputs or [0, 1, 2])


def size_chart(trace: Trace, covariate: str, outputs: list[int]) -> Chart | None:
    """Root mean square error of each push over the predicted one, before and after; 1 is as predicted."""
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
) -> tuple[list[Mark], list[Mark], float]:
    """Root mean square of each push, and in bins with their intervals; and the largest value to be shown."""
    dots: list[Mark] = []
    bars: list[Mark] = []
    top = 0.0
    for values, kind, name in zip(every, kinds, names, strict=True):
        pushes, square = push_means(values.push_id, values.y**2)
        size, bins = np.sqrt(square), means_along(values.axis, values.push_id, values.y, square=True)
        dots.append(
            Dots(kind, push_means(values.push_id, values.axis.x)[1], size, titles(pushes, size, unit), name=one)
        )
        bars.append(bins.bars(kind, unit, name))
        top = max(top, float(bins.high.max(initial=0.0)), float(np.quantile(size, 1.0 - SHARE)) if len(size) else 0.0)
    return dots, bars, top


def _force(table: PushTable, covariate: str, mechanism: str | None) -> Values | None:
    force = table.covariates.get("normal_force")
    if force is None or not len(table):
        return None
    axis = axis_of(table, covariate)
    if mechanism == WRENCH_BIAS and "push_heading" in table.covariates:
        axis = Axis(np.degrees(wrap_angle(table.covariates["push_heading"] - table.inputs[:, 2])), NORMAL, {})
    return Values(axis, table.push_id, force)


def _compared(label: str, unit: str, now: Values, before: Values | None) -> Chart:
    """Pushes and bins along the axis now, and in training: along the same axis, or its range if time is the axis."""
    names, each = push_means(now.push_id, now.y)
    place = push_means(now.push_id, now.axis.x)[1]
    bins = means_along(now.axis, now.push_id, now.y)
    x = limits_of(now.axis.x, margin=0.02)
    known = [] if before is None else [np.quantile(before.y, [0.05, 0.95])]
    y = limits_of(np.quantile(each, [SHARE, 1.0 - SHARE]), bins.low, bins.high, *known)
    marks = (
        *(() if before is None else _training(before, x)),
        Dots("push" if before is None else "before", place, each, titles(names, each, unit), name="one push"),
        bins.bars("before", unit, "pushes, in bins"),
    )
    return Chart(f"{label}.", now.axis.label, label, x, y, marks, names=now.axis.names)


def _training(before: Values, x: tuple[float, float]) -> tuple[Mark, ...]:
    low, middle, high = np.quantile(before.y, [0.05, 0.5, 0.95])
    ends = np.array(x)
    band = Band("push", ends, np.full(2, low), np.full(2, high), name="middle 90 % of the training windows")
    return band, Line("push", ends, np.full(2, middle), name="median in training")
