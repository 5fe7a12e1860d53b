# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The validation report: a self-contained HTML page, its figures as PNG and its numbers as JSON."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from push_predictor.errors import PushPredictorError
from push_predictor.evaluation.judgement import judged
from push_predictor.evaluation.report.figures.calibration import coverage_chart
from push_predictor.evaluation.report.figures.gallery import (
    Validation,
    calibration_pictures,
    example_pictures,
    map_pictures,
    residual_pictures,
)
from push_predictor.evaluation.report.summary import (
    calibration_sentence,
    comparison_sentence,
    opening_sentences,
    training_sentence,
)
from push_predictor.evaluation.report.tables import metrics_tables
from push_predictor.evaluation.validation import Comparison, metrics_json
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.reporting import html
from push_predictor.reporting.canvas import Picture

SECTIONS: tuple[tuple[str, Callable[[Path, Validation], list[Picture]]], ...] = (
    ("Outcomes by contact and angle, predicted and recorded", map_pictures),
    ("Predicted ellipses and observed outcomes", example_pictures),
    ("Calibration of the predicted uncertainty", calibration_pictures),
    ("Residuals over time", residual_pictures),
)
NO_ALARM: Mapping[str, object] = {"fired": False, "off": "the report was made without it"}
NOTHING_FOUND = (
    "No window was found, so the model cannot be judged.",
    "There are no scores and no figures.",
    "Check the recording with `push_predictor check`.",
)
COVERAGE = (
    "Share of the outcomes inside the predicted intervals. On the dashed line the intervals contain the share that "
    "they promise. Below it they are too narrow, above it too wide. Bands: 95 % intervals from resampling pushes."
)


def write_validation_report(
    out: Path,
    title: str,
    table: PushTable,
    windows: Sequence[PushWindow] | None,
    models: Sequence[PushModel],
    comparisons: Sequence[Comparison],
    facts: Mapping[str, str],
    notes: Sequence[str],
    alarm: Mapping[str, object] | None = None,
) -> Path:
    """Write out/report.html, its figures out/*.png and its numbers out/report.json; return the path of the page.

    models and comparisons have the same order, the main model first. comparisons and windows have one row per row of
    the table. facts and notes are shown as given. alarm: of the main model, as in the JSON of `validate`. Raises
    PushPredictorError if these do not match, or if matplotlib or Jinja2 is not installed.
    """
    shown = Validation(table, windows, models, comparisons)
    _check(shown)
    out.mkdir(parents=True, exist_ok=True)
    metrics = [metrics_json(comparison) for comparison in comparisons]
    parts = [
        *_opening(shown, metrics, alarm or NO_ALARM),
        *([html.definitions(facts)] if facts else []),
        html.heading("Scores"),
        *metrics_tables(comparisons, metrics),
        *_pictures(out, shown),
        *([html.heading("Notes"), html.bullets(notes)] if notes else []),
    ]
    content = {"title": title, "facts": dict(facts), "notes": list(notes), "metrics": metrics}
    write_whole(out / "report.json", (json.dumps(content, indent=1) + "\n").encode())
    write_whole(out / "report.html", html.page(title, parts).encode())
    return out / "report.html"


def _check(shown: Validation) -> None:
    count = len(shown.table)
    if not shown.models or len(shown.models) != len(shown.comparisons):
        given = f"{len(shown.models)} models and {len(shown.comparisons)} comparisons"
        raise PushPredictorError(f"report: {given}, give at least one model and a comparison for each")
    for comparison in shown.comparisons:
        if (rows := len(comparison.observed)) != count:
            raise PushPredictorError(f"report: comparison of {comparison.model}: {rows} rows, give the table's {count}")
    if shown.windows is not None and len(shown.windows) != count:
        raise PushPredictorError(f"report: {len(shown.windows)} windows, give the {count} of the table, or None")


def _opening(shown: Validation, metrics: list[dict[str, Any]], alarm: Mapping[str, object]) -> list[str]:
    """Answer first: does the main model fit, is it calibrated, how the others compare, on which data."""
    main, *others = shown.comparisons
    first, rig = {**metrics[0], "alarm": alarm}, shown.models[0].rig
    sentence, used = training_sentence(shown.models, shown.table)
    pushes = html.count(first["n_pushes"], "push", "pushes")
    data = f"{first['n_test']} windows of {pushes} (shape {rig.shape} on {rig.surface}). "
    about = html.paragraph(f"Model {main.model}. {data}{sentence}", "warning" if used else "")
    if not len(shown.table):
        return [html.opening(NOTHING_FOUND, "no push found"), about]
    answers = [calibration_sentence(main), *(comparison_sentence(main, other) for other in others)]
    figure = html.charts([coverage_chart(main)], COVERAGE)
    return [html.opening(opening_sentences(first), judged(first).label, figure), html.bullets(answers), about]


def _pictures(out: Path, shown: Validation) -> list[str]:
    parts: list[str] = []
    if not len(shown.table):
        return parts
    for name, draw_section in SECTIONS:
        parts += [html.heading(name), *map(html.figure, draw_section(out, shown))]
        if draw_section is calibration_pictures and (others := shown.comparisons[1:]):  # the first opens the page
            parts.append(html.charts([coverage_chart(other) for other in others], COVERAGE))
    return parts
