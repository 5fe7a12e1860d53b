"""The report of a validation: one HTML page that stands alone, its pictures and the numbers as JSON beside it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from push_predictor.errors import PushPredictorError
from push_predictor.evaluation import html
from push_predictor.evaluation.figures.canvas import Picture, write_whole
from push_predictor.evaluation.figures.gallery import (
    Validation,
    calibration_pictures,
    example_pictures,
    map_pictures,
    residual_pictures,
)
from push_predictor.evaluation.metrics import COVERAGE_LEVELS, gaussian_nlpd
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.evaluation.validation import Comparison, metrics_json, trained_on
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.recordings.windows import PushWindow
from push_predictor.types import Array

MILLIMETRES = 2.0 * np.log(1000.0)  # what the NLPD total gains when dx and dy are told in mm
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
        *_remarks(facts, notes),
        *_numbers(comparisons, metrics),
        *_pictures(out, shown),
    ]
    content = {"title": title, "facts": dict(facts), "notes": list(notes), "metrics": metrics}
    write_whole(out / "report.json", (json.dumps(content, indent=1) + "\n").encode())
    write_whole(out / "report.html", html.page(title, parts).encode())
    return out / "report.html"


def paired_difference(main: Comparison, other: Comparison) -> tuple[Array, Array]:
    """Total NMSE and total NLPD of `other` less those of `main`: (value, low, high) each, 95 % by drawing whole pushes.

    Both comparisons are of the same windows, so what makes a push hard for both cancels. Low and high are NaN where
    there are fewer than two pushes.
    """
    whole, several = np.ones((1, len(main.push_id))), len(set(main.push_id.tolist())) > 1
    weights = np.vstack([whole, push_bootstrap(main.push_id)]) if several else whole
    nmse = _total_nmse(other, weights) - _total_nmse(main, weights)
    nlpd = _total_nlpd(other, weights) - _total_nlpd(main, weights)
    return _with_ends(nmse), _with_ends(nlpd)


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
        f"{main['n_test']} windows of {main['n_pushes']} pushes (shape {rig.shape} on {rig.surface}), "
        f"predicted by {', '.join(str(m['model']) for m in metrics)}."
    )
    return [html.paragraph(lead, "lead"), *_split(shown)]


def _split(shown: Validation) -> list[str]:
    """What the models have seen of these pushes."""
    seen = {model.name: len(trained_on(model, shown.table)) for model in shown.models}
    if not any(seen.values()):
        text = "Split: recording not used in training; whole pushes are held out, none of them is in a training set."
        return [html.paragraph(text)]
    told = ", ".join(f"{count} by {name}" for name, count in seen.items() if count)
    text = f"Not held out: of {len(shown.table.pushes)} pushes, some were trained on ({told}). The figures flatter."
    return [html.paragraph(text, "warning")]


def _remarks(facts: Mapping[str, str], notes: Sequence[str]) -> list[str]:
    parts = [html.heading("Facts"), html.definitions(facts)] if facts else []
    return [*parts, html.heading("Notes"), html.bullets(notes)] if notes else parts


def _pictures(out: Path, shown: Validation) -> list[str]:
    if not len(shown.table):
        return [html.paragraph("No window was found, so there is nothing to draw.", "warning")]
    parts = []
    for name, draw_section in SECTIONS:
        parts += [html.heading(name), *map(html.figure, draw_section(out, shown))]
    return parts


def _numbers(comparisons: Sequence[Comparison], metrics: Sequence[dict[str, Any]]) -> list[str]:
    tables = [_error_table(metrics), _density_table(metrics), _exact_table(metrics), _coverage_table(metrics)]
    if len(comparisons) > 1 and len(comparisons[0].observed):
        tables.append(_difference_table(comparisons))
    return [html.heading("How good are the predictions?"), *tables]


def _error_table(metrics: Sequence[dict[str, Any]]) -> str:
    head = ("model", "training windows", "windows", "pushes", *OUTPUTS, "total, 95 %")
    rows = [
        [m["model"], str(m["n_train"]), str(m["n_test"]), str(m["n_pushes"]), *_outputs(m["nmse"]), _total(m, "nmse")]
        for m in metrics
    ]
    caption = (
        "Normalised mean squared error: 0 is perfect, 1 as good as always answering the training mean; the total is "
        "the sum over the outputs. Intervals by resampling whole pushes."
    )
    return html.table(caption, head, rows)


def _density_table(metrics: Sequence[dict[str, Any]]) -> str:
    rows = [[m["model"], *_outputs(m["nlpd"]), _total(m, "nlpd"), html.number(m["joint_nlpd"])] for m in metrics]
    caption = (
        f"Negative log predictive density, nats per window in SI units (m, m, rad), moment-matched Gaussian; lower "
        f"is better. In mm and rad, totals and joint are {MILLIMETRES:.4f} higher. Joint: with the full covariance."
    )
    return html.table(caption, ("model", *OUTPUTS, "total, 95 %", "joint"), rows)


def _exact_table(metrics: Sequence[dict[str, Any]]) -> str:
    known = [m for m in metrics if m["exact_nlpd"] is not None]
    if not known:
        return ""
    rows = [[m["model"], *_outputs(m["exact_nlpd"]), html.number(m["exact_nlpd"]["total"])] for m in known]
    caption = "The same under the exact predictive density of the VHGP; that of the other models is the Gaussian above."
    return html.table(caption, ("model", *OUTPUTS, "total"), rows)


def _coverage_table(metrics: Sequence[dict[str, Any]]) -> str:
    head = ("model", *(f"{name} {level:.0%}" for level in COVERAGE_LEVELS for name in OUTPUTS))
    rows = []
    for m in metrics:
        levels = [m["coverage"][str(level)] or dict.fromkeys(OUTPUTS) for level in COVERAGE_LEVELS]
        rows.append([m["model"], *(html.number(found[name]) for found in levels for name in OUTPUTS)])
    return html.table("Coverage: share of outcomes inside the central predicted interval of that level.", head, rows)


def _difference_table(comparisons: Sequence[Comparison]) -> str:
    main, *others = comparisons
    rows = []
    for other in others:
        pairs = (([None if np.isnan(v) else float(v) for v in part]) for part in paired_difference(main, other))
        rows.append([other.model, *(_with_pair(value, low, high) for value, low, high in pairs)])
    caption = (
        f"Difference to {main.model} on the same windows: above zero, {main.model} is better. 95 % intervals by "
        f"resampling whole pushes in pairs."
    )
    return html.table(caption, ("model", "total NMSE", "total NLPD (nats)"), rows)


def _outputs(values: dict[str, float | None]) -> list[str]:
    return [html.number(values[name]) for name in OUTPUTS]


def _total(metrics: dict[str, Any], name: str) -> str:
    return html.with_interval(metrics[name]["total"], metrics["interval"][name])


def _with_pair(value: float | None, low: float | None, high: float | None) -> str:
    return html.with_interval(value, None if low is None else {"low": low, "high": high})


def _total_nmse(c: Comparison, weights: Array) -> Array:
    error, spread = weights @ (c.observed - c.mean) ** 2, weights @ (c.observed - c.training_mean) ** 2
    return np.sum(np.divide(error, spread, out=np.full(error.shape, np.nan), where=spread > 0.0), axis=1)


def _total_nlpd(c: Comparison, weights: Array) -> Array:
    nlpd = gaussian_nlpd(c.mean, c.variance, c.observed).sum(axis=1)
    return np.asarray(weights @ nlpd / weights.sum(axis=1))


def _with_ends(draws: Array) -> Array:
    """The first draw is the value itself; the rest give its 95 % interval."""
    ends = np.nanquantile(draws[1:], [0.025, 0.975]) if len(draws) > 1 else np.full(2, np.nan)
    return np.array([draws[0], *ends])
