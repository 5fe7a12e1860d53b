"""The report of a validation: one HTML page that stands alone, its pictures and the numbers as JSON beside it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from push_predictor.errors import PushPredictorError
from push_predictor.evaluation.report.figures.gallery import (
    Validation,
    calibration_pictures,
    example_pictures,
    map_pictures,
    residual_pictures,
)
from push_predictor.evaluation.report.tables import metrics_tables
from push_predictor.evaluation.validation import Comparison, metrics_json, trained_on
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.reporting import html
from push_predictor.reporting.canvas import Picture

SECTIONS: tuple[tuple[str, Callable[[Path, Validation], list[Picture]]], ...] = (
    ("Predicted and recorded maps", map_pictures),
    ("Predicted ellipses over observed outcomes", example_pictures),
    ("Calibration", calibration_pictures),
    ("Residuals", residual_pictures),
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
) -> Path:
    """Write out/report.html, its pictures out/*.png and the numbers out/report.json; returns the path of the page.

    models and comparisons go together, the first is the main one; comparisons and windows have a row per row of the
    table. facts and notes are shown as they are given. Raises PushPredictorError if these do not fit together or if
    matplotlib is not installed.
    """
    shown = Validation(table, windows, models, comparisons)
    _check(shown)
    out.mkdir(parents=True, exist_ok=True)
    metrics = [metrics_json(comparison) for comparison in comparisons]
    parts = [
        *_summary(shown, metrics),
        *([html.definitions(facts)] if facts else []),
        html.heading("How good are the predictions?"),
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


def _summary(shown: Validation, metrics: Sequence[dict[str, Any]]) -> list[str]:
    main, rig = metrics[0], shown.models[0].rig
    lead = (
        f"{main['n_test']} windows of {_pushes(main['n_pushes'])} (shape {rig.shape} on {rig.surface}), "
        f"predicted by {', '.join(str(m['model']) for m in metrics)}."
    )
    return [html.paragraph(lead, "lead"), *_split(shown)]


def _split(shown: Validation) -> list[str]:
    """What the models have seen of these pushes."""
    seen = {model.name: len(trained_on(model, shown.table)) for model in shown.models}
    if not any(seen.values()):
        text = "Split by push: whole pushes are held out, none of these was used to train any of the models."
        return [html.paragraph(text)]
    told = ", ".join(f"{count} by {name}" for name, count in seen.items() if count)
    pushes = _pushes(len(shown.table.pushes))
    text = f"Not held out: of {pushes}, some were trained on ({told}). Figures and pictures flatter those models."
    return [html.paragraph(text, "warning")]


def _pushes(count: int) -> str:
    return f"{count} push" if count == 1 else f"{count} pushes"


def _pictures(out: Path, shown: Validation) -> list[str]:
    if not len(shown.table):
        return [html.paragraph("No window was found, so there is nothing to draw.", "warning")]
    parts = []
    for name, draw_section in SECTIONS:
        parts += [html.heading(name), *map(html.figure, draw_section(out, shown))]
    return parts
