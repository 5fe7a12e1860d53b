# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The maps of a trace's report: mean residual over contact point and push angle, with captions."""

from __future__ import annotations

import numpy as np

from push_predictor.evaluation.report.figures.push_maps import contact_label
from push_predictor.recordings.table import OUTPUTS
from push_predictor.reporting import html
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.maps import Column, Halves, columns_of, halves_of, map_charts
from push_predictor.residuals.reporting.figures.partial import strength_of
from push_predictor.residuals.reporting.phrases import covariate_phrase


def map_figures(trace: Trace) -> list[str]:
    """Maps of the analysis pushes and of the held-out pushes."""
    figures = []
    for title, columns in (
        ("analysis pushes", _analysis_columns(trace)),
        ("held-out pushes", _held_out_columns(trace)),
    ):
        shown = map_charts(trace.model.rig.outline, columns) if columns else []
        if shown:
            per_row = len(columns) if len(columns) > 1 else len(OUTPUTS)
            figures.append(html.charts(shown, _map_caption(trace, title, columns), per_row))
    return figures


def _analysis_columns(trace: Trace) -> list[Column]:
    if not len(trace.analysis):
        return []
    halves = _halves(trace, "analysis")
    after = "after" if trace.terms or trace.verdict == "measurement" else "refit"
    columns = columns_of("before", trace.analysis, trace.residual, halves)
    if len(trace.unexplained) == len(trace.analysis) and not np.array_equal(trace.unexplained, trace.residual):
        columns += columns_of(after, trace.analysis, trace.unexplained, halves)
    return columns


def _held_out_columns(trace: Trace) -> list[Column]:
    table, shown = trace.held_out.table, trace.comparisons
    shown = shown[::2] if trace.verdict == "measurement" and len(shown) > 2 else shown[-2:]
    if not len(table) or any(len(comparison.observed) != len(table) for comparison in shown):
        return []
    halves = _halves(trace, "held out")
    return [c for each in shown for c in columns_of(each.model, table, each.residuals, halves)]


def _halves(trace: Trace, part: str) -> Halves:
    strength = strength_of(trace.terms[0], trace.analysis) if trace.terms else None
    return halves_of(strength, trace.analysis if part == "analysis" else trace.held_out.table)


def _map_caption(trace: Trace, title: str, columns: list[Column]) -> str:
    seen = title == "analysis pushes"
    pushes = len((trace.analysis if seen else trace.held_out.table).pushes)
    trust = (
        "The search used these pushes, so a smaller residual here is no proof."
        if seen
        else "Nothing was fitted or chosen on these pushes."
    )
    after = "the deployed model on windows cut again" if trace.verdict == "measurement" else "with the effects found"
    meaning = {"before": "the deployed model", "refit": "retrained on the analysis pushes", "after": after}
    models = [f"{name.capitalize()}: {meaning[name]}." for name in dict.fromkeys(column.title for column in columns)]
    return (
        f"Mean residual of {pushes} {title} over contact point and push angle, in units of the predicted standard "
        f"deviation. {' '.join(models)}{_split_words(trace, columns)} {trust} Up: push angle. Across: "
        f"{contact_label(trace.model.rig.outline)}. Grey: fewer than six windows."
    )


def _split_words(trace: Trace, columns: list[Column]) -> str:
    """Why the maps are split, if they are."""
    if not any(column.part for column in columns):
        return ""
    where = "at the step" if trace.terms[0].basis.name == "step" else "at the median strength of the first effect"
    name = covariate_phrase(trace.terms[0].covariate)
    return f" Maps are split {where}: an effect that changes with {name} may cancel in one map of all pushes."
