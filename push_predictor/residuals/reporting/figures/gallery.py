# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The figures of a trace's report below the key picture, with their captions."""

from __future__ import annotations

from push_predictor.reporting import html
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.driver_basis import basis_charts
from push_predictor.residuals.reporting.figures.errors import coverage_charts, error_charts
from push_predictor.residuals.reporting.figures.partial import Rows, Strength, analysis_rows, held_out_rows, strength_of
from push_predictor.residuals.reporting.phrases import (
    capitalised,
    count,
    covariate_phrase,
    listed,
    moved_noun,
)

BARS = "Bars: 95 % intervals from a bootstrap of pushes."


def effect_figures(trace: Trace) -> list[str]:
    """Each effect that depends on a covariate, against that."""
    driven = [effect for effect in trace.terms if effect.basis.drivers]
    if not driven:
        return []
    analysis, held_out = analysis_rows(trace), _held_out_rows(trace)
    return [_basis_figure(trace, strength_of(effect, trace.analysis), analysis, held_out) for effect in driven]


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


def calibration_figures(trace: Trace) -> list[str]:
    """Coverage and PIT before, after the refit and with the effects."""
    shown = [comparison for comparison in trace.comparisons if len(comparison.observed)]
    if not shown:
        return []
    caption = (
        f"Calibration on {count(len(trace.held_out.table.pushes), 'held-out push', 'held-out pushes')}. First column: "
        "share of outcomes inside the central predicted interval, against its nominal share; band: 95 %, bootstrap of "
        "pushes. Others: probability integral transform (PIT), uniform for a calibrated model. A hump: the predicted "
        "uncertainty is too large. A trough: it is too small. A slope: the mean is biased. Grey: 95 % range of the "
        "bars of a calibrated model, where windows of a push resemble each other."
    )
    return [html.charts([chart for one in shown for chart in coverage_charts(one)], caption, 4)]


def _basis_figure(trace: Trace, strength: Strength, analysis: Rows, held_out: Rows | None) -> str:
    effect = strength.effect
    name = capitalised(moved_noun(effect.mechanism))
    covariates = listed([covariate_phrase(driver) for driver in effect.basis.drivers])
    data = (
        "Background: the fitted map. Dots: single pushes, in the colour of their own estimate."
        if len(effect.basis.drivers) > 1
        else "Line: fitted, with its 95 % band. Points: estimated separately in each bin, from the residuals of the "
        f"model and the other effects. {BARS} Grey dots: single pushes; those with too small a response are not shown."
    )
    pattern = (
        ""
        if strength.share > 0.999
        else " The mechanism is unknown, so the strongest pattern over contact point and push angle is shown: "
        f"{100.0 * strength.share:.0f} % of the fitted coefficients' sum of squares."
    )
    caption = f"{name} against {covariates} ({effect.basis.name}). {data} {_data_words(trace)}{pattern}"
    return html.charts(basis_charts(trace, strength, analysis, held_out), caption)


def _held_out_rows(trace: Trace) -> Rows | None:
    held = trace.held_out
    return held_out_rows(trace) if len(held.table) and len(held.after.observed) == len(held.table) else None


def _data_words(trace: Trace) -> str:
    model = "extended" if trace.extended is not None else "deployed"
    pushes = count(len(trace.analysis.pushes), "analysis push", "analysis pushes")
    return f"Data: {pushes}, residuals of the {model} model."
