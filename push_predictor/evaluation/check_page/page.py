# Copyright 2026 The push_predictor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The page of a check, and the same content as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from push_predictor.evaluation.check_page.answer import answer_of, with_minus
from push_predictor.evaluation.check_page.figures import correction_of, coverage_charts, track_charts
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.checks.checked import CheckedData
from push_predictor.recordings.checks.finding import Value
from push_predictor.reporting import html

TRACKS = "Tracks: the tip (grey; orange while the slider moves) and the tracked frame of the slider (blue), from above."
CONTACTS = (
    " Contacts: the points that the tip touches (orange), in the slider's frame, and the rig's outline (black). In "
    "sound data they lie on it."
)
CORRECTED = " Blue: the outline corrected by the estimates below."


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
    """Answer, correction of the outline, and coverage; the findings have their own key."""
    sentences, label = answer_of(checked)
    correction = correction_of(checked.findings)
    return {
        "verdict": label,
        "answer": sentences,
        "correction": None if correction is None else correction.record(),
        "coverage": None if checked.coverage is None else checked.coverage.record(),
    }


def _parts(checked: CheckedData) -> list[str]:
    parts = [html.answer(*answer_of(checked))]
    if charts := track_charts(checked):
        corrected = CORRECTED if correction_of(checked.findings) is not None else ""
        parts.append(html.charts(charts, TRACKS + (CONTACTS + corrected if len(charts) > 1 else "")))
    parts.append(html.heading("Findings"))
    parts += [
        html.finding(finding.name.replace("_", " "), finding.severity, with_minus(finding.text))
        for finding in checked.findings
    ] or [html.paragraph("None.")]
    return [*parts, *_numbers(checked), *_coverage(checked)]


def _numbers(checked: CheckedData) -> list[str]:
    """A folded table of the estimates."""
    rows = [
        [f"{finding.name}, {name}", f"{html.number(value.value)} {_unit(value)}", _sd(value)]
        for finding in checked.findings
        for name, value in finding.values.items()
    ]
    if not rows:
        return []
    table = html.table("Estimates with their standard deviations.", ("finding", "value", "sd"), rows)
    return [html.details("Estimates in numbers", table)]


def _coverage(checked: CheckedData) -> list[str]:
    if checked.coverage is None or checked.table is None:
        return []
    coverage = checked.coverage
    rows = [[name.replace("_", " "), _listed(value)] for name, value in coverage.record().items()]
    table = html.table("Middle 90 % of speeds (m/s) and angles (rad).", ("what was pushed", "value"), rows)
    caption = "What the pushes cover. A learnt model predicts well only where pushes were recorded."
    return [
        html.heading("Coverage"),
        html.charts(coverage_charts(coverage, checked.table), caption),
        html.details("Coverage in numbers", table),
    ]


def _listed(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(html.number(each, 3) for each in value)
    return html.number(float(value), 3) if isinstance(value, int | float) else html.NOTHING


def _unit(value: Value) -> str:
    return "" if value.unit == "1" else value.unit


def _sd(value: Value) -> str:
    return html.number(value.sd, 2)
