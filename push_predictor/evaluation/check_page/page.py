# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The page of a check, and the same content as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from push_predictor.evaluation.check_page.answer import answer_of, contact_sentence, with_minus
from push_predictor.evaluation.check_page.figures import contact_chart, correction_of, coverage_charts, track_chart
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.checks.checked import CheckedData
from push_predictor.recordings.checks.finding import Value
from push_predictor.reporting import html

TRACKS = "The tip (grey; orange while the slider moves) and the tracked frame of the slider (blue), from above."
CONTACTS = "The points that the tip touches, in the slider's frame. In sound data they lie on the outline. "
PUSHES = "Each push by speed and angle."


def write_check_page(path: Path, checked: Mapping[str, CheckedData]) -> None:
    """Write the page about all data, by path. Raises PushPredictorError without Jinja2, OSError that names the path."""
    parts = []
    for name, data in checked.items():
        if len(checked) > 1:
            parts.append(html.heading(name))
        parts += _parts(data)
    names = [Path(name).name for name in checked]
    title = f"Check of {names[0] if len(names) == 1 else f'{len(names)} recordings and tables'}"
    write_whole(path, html.page(title, parts).encode())


def check_json(checked: CheckedData) -> dict[str, object]:
    """Answer, correction of the outline, contacts, and coverage; the findings have their own key."""
    sentences, label = answer_of(checked)
    correction = correction_of(checked.findings)
    return {
        "verdict": label,
        "answer": sentences,
        "correction": None if correction is None else correction.record(),
        "contacts": None if checked.contacts is None else checked.contacts.record(),
        "coverage": None if checked.coverage is None else checked.coverage.record(),
    }


def _parts(checked: CheckedData) -> list[str]:
    sentences, label = answer_of(checked)
    parts = [html.opening(sentences, label, _figure(checked)), html.heading("Findings")]
    parts += [
        html.finding(finding.name.replace("_", " "), finding.severity, with_minus(finding.text))
        for finding in checked.findings
    ] or [html.paragraph("None.")]
    return [*parts, *_numbers(checked), *_contacts(checked), *_coverage(checked)]


def _figure(checked: CheckedData) -> str:
    """The contacts on the outline, for a table its pushes."""
    if checked.contacts is not None and (chart := contact_chart(checked)) is not None:
        return html.charts([chart], CONTACTS + contact_sentence(checked.contacts))
    if checked.recording is None and checked.coverage is not None and checked.table is not None:
        return html.charts(coverage_charts(checked.coverage, checked.table)[:1], PUSHES)
    return ""


def _contacts(checked: CheckedData) -> list[str]:
    """The gap on each side, folded, and the tracks."""
    parts = []
    if (fit := checked.contacts) is not None:
        caption = f"Median gap between tip and outline by {fit.side}. Counted counter-clockwise from the first vertex."
        rows = [[str(k + 1), _millimetres(gap)] for k, gap in enumerate(fit.gaps)]
        parts.append(html.folded_table(caption, (fit.side, "gap, mm"), rows))
    if (chart := track_chart(checked)) is not None:
        parts.append(html.charts([chart], TRACKS))
    return [html.heading("Contacts and tracks"), *parts] if parts else []


def _numbers(checked: CheckedData) -> list[str]:
    """A folded table of the estimates."""
    rows = [
        [f"{finding.name}, {name}", f"{html.number(value.value)} {_unit(value)}", _sd(value)]
        for finding in checked.findings
        for name, value in finding.values.items()
    ]
    caption = "Estimates in numbers. With their standard deviations."
    return [html.folded_table(caption, ("finding", "value", "sd"), rows)] if rows else []


def _coverage(checked: CheckedData) -> list[str]:
    if checked.coverage is None or checked.table is None:
        return []
    coverage = checked.coverage
    rows = [[name.replace("_", " "), _listed(value)] for name, value in coverage.record().items()]
    numbers = "Coverage in numbers. Middle 90 % of speeds (m/s) and angles (rad)."
    caption = "What the pushes cover. A learnt model predicts well only where pushes were recorded."
    charts = coverage_charts(coverage, checked.table)
    shown = charts if checked.recording is not None else charts[1:]  # a table's first one is the figure of the opening
    return [
        html.heading("Coverage"),
        *([html.charts(shown, caption)] if shown else []),
        html.folded_table(numbers, ("what was pushed", "value"), rows),
    ]


def _millimetres(gap: float | None) -> str:
    return html.NOTHING if gap is None else html.number(1e3 * gap, 2)


def _listed(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(html.number(each, 3) for each in value)
    return html.number(float(value), 3) if isinstance(value, int | float) else html.NOTHING


def _unit(value: Value) -> str:
    return "" if value.unit == "1" else value.unit


def _sd(value: Value) -> str:
    return html.number(value.sd, 2)
