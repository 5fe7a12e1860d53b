# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The error of each held-out push before and after, and how well the predicted intervals cover the outcomes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.evaluation.report.figures.calibration import KINDS, coverage_chart, expected_counts, histogram
from push_predictor.evaluation.validation import Comparison, pit
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.reporting.canvas import UNITS
from push_predictor.reporting.chart import HALF, Band, Chart, Columns, Dots, Line, Mark, limits_of
from push_predictor.residuals.reporting.figures.pushes import Axis, axis_of, means_along, push_means, titles
from push_predictor.types import Array, TextArray

QUARTER = (215.0, 195.0)
MODELS = {"before": "before", "refit": "push", "after": "after"}
SHARE = 0.02  # of the pushes that may lie above the picture


@dataclass(frozen=True, eq=False)
class Judged:
    """Windows (n,) under a model: push, position on the axis, error (n, 2) of position (mm) and heading (deg)."""

    model: str
    push_id: TextArray
    x: Array
    size: Array


def error_charts(table: PushTable, covariate: str, shown: Sequence[Comparison]) -> list[Chart]:
    """Error of the position (mm) and of the heading (deg) of each push under each model, along the covariate.

    A model may have been judged on other windows of the same pushes.
    """
    axis = axis_of(table, covariate)
    place = dict(zip(*push_means(table.push_id, axis.x), strict=True))
    judged = [_judged(comparison, place) for comparison in shown]
    labels = "Position error of a push (mm)", "Heading error of a push (deg)"
    return [_error_chart(axis, judged, k, *each) for k, each in enumerate(zip(labels, ("mm", "deg"), strict=True))]


def coverage_charts(comparison: Comparison) -> list[Chart]:
    """The coverage curve, and a histogram of the probability integral transform for each output."""
    values = pit(comparison)
    bars = [histogram(values[:, k]) for k in range(len(OUTPUTS))]
    tallest = max(float(counts.max()) for counts, _ in bars)
    expected = [expected_counts(values[:, k], comparison.push_id) for k in range(len(OUTPUTS))]
    charts = [_pit_chart(*bars[k], expected[k], k, tallest) for k in range(len(OUTPUTS))]
    return [replace(coverage_chart(comparison), title=comparison.model, size=QUARTER), *charts]


def _judged(comparison: Comparison, place: dict[str, float]) -> Judged:
    known = np.array([push in place for push in comparison.push_id.tolist()], dtype=np.bool_)
    error = ((comparison.observed - comparison.mean) * UNITS)[known]
    push_id = comparison.push_id[known]
    x = np.array([place[push] for push in push_id.tolist()])
    size = np.column_stack([np.hypot(error[:, 0], error[:, 1]), np.abs(error[:, 2])])
    return Judged(comparison.model, push_id, x, size)


def _error_chart(axis: Axis, judged: Sequence[Judged], k: int, label: str, unit: str) -> Chart:
    dots: list[Mark] = []
    bars: list[Mark] = []
    ends: list[Array] = [np.zeros(1)]
    alike = len({one.push_id.tobytes() for one in judged}) == 1
    for one in judged:
        kind, size = MODELS[one.model], one.size[:, k]
        names, square = push_means(one.push_id, size**2)
        each, bins = np.sqrt(square), means_along(replace(axis, x=one.x), one.push_id, size, square=True)
        dots.append(Dots(kind, push_means(one.push_id, one.x)[1], each, titles(names, each, unit)))
        if alike:
            bars.append(Line(kind, bins.place, bins.value))
        bars.append(bins.bars(kind, unit, one.model))
        ends += [bins.high, np.quantile(each, [1.0 - SHARE]) if len(each) else np.zeros(0)]
    x, y = limits_of(axis.x, margin=0.02), (0.0, limits_of(*ends)[1])
    return Chart(f"{label} before and after.", axis.label, label, x, y, (*dots, *bars), size=HALF, names=axis.names)


def _pit_chart(counts: Array, edges: Array, expected: tuple[float, float], output: int, tallest: float) -> Chart:
    low, high = expected
    across = np.array([0.0, 1.0])
    band = Band("push", across, np.full(2, low), np.full(2, high))
    top = 1.08 * max(tallest, float(high))
    name = OUTPUTS[output]
    marks = Columns(KINDS[output], edges, counts), band
    return Chart(
        f"Histogram of the PIT of {name}.", "Predicted probability", "Windows", (0.0, 1.0), (0.0, top), marks,
        title=f"PIT of {name}", size=QUARTER,
    )  # fmt: skip
