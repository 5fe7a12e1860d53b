"""The maps of a trace's report: mean residual over contact point and push angle, with captions."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from push_predictor.evaluation.report.figures.residuals import standardised_residuals
from push_predictor.reporting.canvas import Picture, draw
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.maps import Column, Halves, columns_of, halves_of, paint_residual_maps
from push_predictor.residuals.reporting.figures.partial import strength_of
from push_predictor.residuals.reporting.phrases import covariate_phrase
from push_predictor.residuals.reporting.summary import comparisons_of

SIZE = (10.0, 6.6)  # inches


def map_pictures(out: Path, trace: Trace) -> list[Picture]:
    """Maps of the analysis pushes and of the held-out pushes."""
    pictures = []
    for name, title, columns in (
        ("maps_analysis", "analysis pushes", _analysis_columns(trace)),
        ("maps_held_out", "held-out pushes", _held_out_columns(trace)),
    ):
        if not columns:
            continue
        path = out / f"{name}.png"
        draw(path, SIZE, partial(paint_residual_maps, outline=trace.model.rig.outline, columns=columns))
        pictures.append(Picture(path, f"Maps of the mean residual of {title}.", _map_caption(trace, title, columns)))
    return pictures


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
    table, shown = trace.held_out.table, comparisons_of(trace)
    shown = shown[::2] if trace.verdict == "measurement" and len(shown) > 2 else shown[-2:]
    if not len(table) or any(len(comparison.observed) != len(table) for comparison in shown):
        return []
    halves = _halves(trace, "held out")
    return [c for each in shown for c in columns_of(each.model, table, standardised_residuals(each), halves)]


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
    shown = dict.fromkeys(column.title.partition("\n")[0] for column in columns)
    models = [f"{name.capitalize()}: {meaning[name]}." for name in shown]
    numbers = " Numbers: pushes." if len(columns) < 3 else ""
    return (
        f"Mean residual of {pushes} {title} over contact point and push angle, in units of the predicted standard "
        f"deviation; orange is positive, purple negative. {' '.join(models)}{_split_words(trace)} {trust}{numbers} "
        "Hatched: fewer than six windows."
    )


def _split_words(trace: Trace) -> str:
    """How the maps are split, if the first effect depends on a covariate."""
    if not trace.terms or not trace.terms[0].basis.drivers:
        return ""
    name = covariate_phrase(trace.terms[0].covariate)
    return (
        f" Maps are split at the median strength of the first effect, because an effect that changes with {name} may "
        "cancel in one map of all pushes."
    )
