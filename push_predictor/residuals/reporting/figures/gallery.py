# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The figures of a trace's report with their captions: the key picture, one for each verdict, then the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.reporting import html
from push_predictor.reporting.chart import WIDE, Chart, Dots
from push_predictor.reporting.html import count
from push_predictor.residuals.evidence.standardised import Evidence
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.driver_basis import (
    Strength,
    analysis_rows,
    basis_charts,
    strength_of,
)
from push_predictor.residuals.reporting.figures.pushes import (
    error_charts,
    force_chart,
    gap_chart,
    input_chart,
    size_chart,
)
from push_predictor.residuals.reporting.phrases import (
    capitalised,
    covariate_phrase,
    listed,
    mechanism_phrase,
)

BARS = "Bars: 95 % intervals from a bootstrap of pushes."
EFFECT = "Each grey dot is one push: the size of the effect that this push alone shows."
MAP = "The background is the fitted map. Each dot is one push, in the colour of the effect that this push alone shows."
SIZE = "Each dot is one push: the size of its error. At 1 the errors are as large as the model predicts."
FORCE = "Each dot is one push: its mean force now. Grey: the force in training."
GAP = "Each dot is one push: the gap that was measured while the tip touched the slider. Without an error it is zero."
INPUTS = "Where the pushes of training and the new pushes lie. Outside the training range the model extrapolates."
MEANS = "Points with bars: means of neighbouring pushes, with 95 % intervals."
HOVER = "Hover over a mark to see its push and its value."


def effect_figures(trace: Trace) -> list[str]:
    """Each known effect that depends on a covariate against that, but for what the key picture shows."""
    known = [term for term in trace.terms if term.basis.drivers and term.mechanism is not None]
    every = [strength_of(term) for term in known]
    shown = [one for one in every if one.effect is not trace.terms[0] or len(one.names) > 1]
    if not shown:
        return []
    rows = analysis_rows(trace)
    return [_basis_figure(trace, one, rows) for one in shown]


def error_figure(trace: Trace) -> list[str]:
    """The error of each held-out push before and after, along the first effect's covariate or the time."""
    table, shown = trace.held_out.table, trace.comparisons
    if not len(table):
        return []
    shown = [shown[0], shown[-1]]
    covariate = trace.effects[0].covariate if trace.effects else ""
    words = "Orange: before. Blue: after." if shown[-1].model == "after" else "Orange: before. Grey: refit."
    caption = f"Error of {count(len(table.pushes), 'held-out push', 'held-out pushes')}, each a dot. {words} {BARS}"
    return [html.charts(error_charts(table, covariate, shown), caption)]


def _basis_figure(trace: Trace, strength: Strength, rows: Evidence) -> str:
    effect = strength.effect
    name = capitalised(mechanism_phrase(effect.mechanism))
    covariates = listed([covariate_phrase(driver) for driver in effect.basis.drivers])
    data = (
        "Background: the fitted map. Dots: single pushes, in the colour of their own estimate."
        if len(effect.basis.drivers) > 1
        else "Line: fitted, with its 95 % band. Grey dots: what single pushes show, from the residuals of the model "
        f"and the other effects; those with too small a response are not shown. {MEANS}"
    )
    caption = f"{name} against {covariates} ({effect.basis.name}). {data}"
    return html.charts(basis_charts(trace, strength, rows), caption)


def key_figure(trace: Trace) -> list[str]:
    """The key picture with its caption; none if these windows do not contain the data."""
    charts, text = _charts(trace)
    charts = [replace(chart, size=WIDE) for chart in charts] if len(charts) == 1 and not charts[0].key else charts
    if not charts:
        return []
    bars = "" if text in (MAP, INPUTS) else f" {MEANS}"
    hidden = sum(_outside(chart) for chart in charts)
    cut = f" {count(hidden, 'push lies', 'pushes lie')} outside the picture." if hidden else ""
    return [html.charts(charts, f"{text}{bars}{cut} {HOVER}")]


def _charts(trace: Trace) -> tuple[list[Chart], str]:
    if trace.verdict == "wrench_only":
        return _known(force_chart(trace)), FORCE
    if trace.verdict == "measurement":
        return _known(gap_chart(trace)), GAP
    if trace.verdict == "input_shift":
        return _known(*(input_chart(trace, shift.covariate) for shift in trace.input_shift)), INPUTS
    if trace.terms and trace.effects[0].mechanism is not None:
        return [_effect_chart(trace)], MAP if len(trace.terms[0].basis.drivers) > 1 else EFFECT
    return _known(size_chart(trace)), SIZE


def _effect_chart(trace: Trace) -> Chart:
    """The chart of the first effect's parameter that changes most."""
    strength = strength_of(trace.terms[0])
    values = strength.curve(trace.analysis.covariates, len(trace.analysis))[0]
    most = int(np.argmax(np.abs(values).max(axis=0)))
    return basis_charts(trace, strength, analysis_rows(trace))[most]


def _known(*charts: Chart | None) -> list[Chart]:
    return [chart for chart in charts if chart is not None]


def _outside(chart: Chart) -> int:
    """Dots that lie outside the plot area; unknown ones are none."""
    dots = [mark for mark in chart.marks if isinstance(mark, Dots)]
    return sum(int(np.sum(np.isfinite(d.y) & ~chart.frame.inside(d.x, d.y))) for d in dots)
