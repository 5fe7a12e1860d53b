# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The page of a check with its figures, and the same content as JSON."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from push_predictor.geometry.frames import rotate, to_body
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.checks.check import CheckedData
from push_predictor.recordings.checks.coverage import OFF, ContactFit, Coverage
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.checks.motion import Motion, motion_of
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.reporting import html
from push_predictor.reporting.chart import (
    BOTTOM,
    HALF,
    LEFT,
    LINE,
    RIGHT,
    TOP,
    Chart,
    Columns,
    Dots,
    Line,
    Mark,
    limits_of,
)
from push_predictor.types import Array

TRACKS = "The tip (grey; orange while the slider moves) and the tracked frame of the slider (blue), from above."
CONTACTS = "The points that the tip touches, in the slider's frame. In sound data they lie on the outline. "
PUSHES = "Each push by speed and angle."
MOST_POINTS = 1500  # of a track
MOST_CONTACTS = 700
MOST_PUSHES = 600  # dots
SQUARE = (460.0, 430.0)  # pixels
MM = 1e3
ORDER = ("refused", "warning", "note")
LABELS = {"refused": "refused", "warning": "check first", "note": "sound"}


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
    return [*parts, *_numbers(checked), *_contact_parts(checked), *_coverage(checked)]


def _figure(checked: CheckedData) -> str:
    """The contacts on the outline, for a table its pushes."""
    if checked.contacts is not None and (chart := contact_chart(checked)) is not None:
        return html.charts([chart], CONTACTS + contact_sentence(checked.contacts))
    if checked.recording is None and checked.coverage is not None and checked.table is not None:
        return html.charts(coverage_charts(checked.coverage, checked.table)[:1], PUSHES)
    return ""


def _contact_parts(checked: CheckedData) -> list[str]:
    """The gap on each side, folded, and the tracks."""
    parts = []
    if (fit := checked.contacts) is not None:
        caption = f"Median gap between tip and outline by {fit.side}. Counted counter-clockwise from the first vertex."
        rows = [[str(k + 1), html.number(gap and 1e3 * gap, 2)] for k, gap in enumerate(fit.gaps)]
        parts.append(html.folded_table(caption, (fit.side, "gap, mm"), rows))
    if (chart := track_chart(checked)) is not None:
        parts.append(html.charts([chart], TRACKS))
    return [html.heading("Contacts and tracks"), *parts] if parts else []


def _numbers(checked: CheckedData) -> list[str]:
    """A folded table of the estimates."""
    rows = [
        [
            f"{finding.name}, {name}",
            f"{html.number(value.value)} {'' if value.unit == '1' else value.unit}",
            html.number(value.sd, 2),
        ]
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


def _listed(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(html.number(each, 3) for each in value)
    return html.number(float(value), 3) if isinstance(value, int | float) else html.NOTHING


@dataclass(frozen=True)
class Correction:
    """The estimated place of the slider in the tracked frame: yaw rad, shift x and y m, and its relative size."""

    yaw: float = 0.0
    x: float = 0.0
    y: float = 0.0
    scale: float = 1.0

    def record(self) -> dict[str, float]:
        """The entry in the JSON."""
        return {"yaw": self.yaw, "x": self.x, "y": self.y, "scale": self.scale}

    def own(self, points: Array) -> Array:
        """Points (n, 2) of the tracked frame in the outline's."""
        return rotate(points - [self.x, self.y], np.array(-self.yaw)) / self.scale

    def tracked(self, points: Array) -> Array:
        """Points (n, 2) of the outline in the tracked frame."""
        return rotate(self.scale * points, np.array(self.yaw)) + [self.x, self.y]


def correction_of(findings: Sequence[Finding]) -> Correction | None:
    """The correction of the outline that findings estimate, None if they estimate none."""
    values = {name: value.value for finding in findings for name, value in finding.values.items()}
    known = {name: values[name] for name in ("yaw", "x", "y", "scale") if name in values}
    return Correction(**known) if known else None


def contact_chart(checked: CheckedData) -> Chart | None:
    """The contacts on the outline, None for a table and for a recording without contact."""
    motion = _motion(checked)
    if motion is None or checked.rig is None or not motion.contact.any():
        return None
    return _contacts(motion, checked.rig, correction_of(checked.findings))


def track_chart(checked: CheckedData) -> Chart | None:
    """The tracks of slider and tip, None for a table, and where they have no common time."""
    motion = _motion(checked)
    if motion is None:
        return None
    slider, tip = MM * motion.slider[:, :2], MM * motion.tip
    thin = slice(None, None, max(1, -(-len(tip) // MOST_POINTS)))
    marks: list[Mark] = [Line("push", *tip[thin].T, name="tip")]
    numbers = np.unique(motion.push[motion.contact])
    every = max(1, -(-int(motion.contact.sum()) // MOST_POINTS))
    for count, number in enumerate(numbers):
        rows = np.flatnonzero(motion.contact & (motion.push == number))
        rows = np.unique(np.append(rows[::every], rows[-1]))
        marks += [
            Line("before", *tip[rows].T, name="" if count else "tip while the slider moves"),
            Line("fit", *slider[rows].T, name="" if count else "slider's frame, pushed"),
        ]
    x, y = _equal(np.concatenate([slider, tip]))
    label = "Tracks of the tip and of the slider from above"
    return Chart(label, "x, mm", "y, mm", x, y, tuple(marks), "Tracks from above", SQUARE)


def _motion(checked: CheckedData) -> Motion | None:
    if checked.recording is None or checked.rig is None:
        return None
    return motion_of(checked.recording, checked.rig)


def coverage_charts(coverage: Coverage, table: PushTable) -> list[Chart]:
    """Pushes by speed and angle, and windows by side."""
    first = np.unique(table.push_id, return_index=True)[1]
    shown = np.sort(first)[:: max(1, -(-len(first) // MOST_PUSHES))]
    speed, angle = MM * table.inputs[shown, 0], np.degrees(table.inputs[shown, 2])
    titles = [f"push {name}" for name in table.push_id[shown]]
    charts = [
        Chart(
            "Speed and angle of each push",
            "speed, mm/s",
            "angle to the inward normal, degrees",
            (0.0, 1.1 * float(speed.max())),
            (-90.0, 90.0),
            (Dots("after", speed, angle, titles),),
            "Pushes by speed and angle",
            HALF,
        )
    ]
    if (counts := coverage.side_counts) is not None:
        edges = np.arange(len(counts) + 1) + 0.5
        charts.append(
            Chart(
                f"Windows on each {coverage.side}",
                f"{coverage.side}, counter-clockwise from the first vertex",
                "windows",
                (0.5, len(counts) + 0.5),
                (0.0, 1.1 * max(1.0, float(counts.max()))),
                (Columns("fit", np.asarray(edges, dtype=np.float64), np.asarray(counts, dtype=np.float64)),),
                f"Windows by {coverage.side}",
                HALF,
                names={float(k + 1): str(k + 1) for k in range(len(counts))},
            )
        )
    return charts


def _contacts(motion: Motion, rig: Rig, correction: Correction | None) -> Chart:
    rows = np.flatnonzero(motion.contact)
    rows = rows[:: max(1, -(-len(rows) // MOST_CONTACTS))]
    tips, place = to_body(motion.tip[rows], motion.slider[rows]), correction or Correction()
    normal = rotate(rig.outline.project(place.own(tips)).normal, np.array(place.yaw))
    points = MM * (tips - rig.pusher_radius * normal)
    outline = np.vstack([rig.outline.vertices, rig.outline.vertices[:1]])
    marks: list[Mark] = [Line("held", *(MM * outline).T, name="outline of the rig")]
    every = MM * outline
    if correction is not None:
        corrected = MM * correction.tracked(outline)
        marks.append(Line("after", *corrected.T, name="corrected outline"))
        every = np.vstack([every, corrected])
    titles = [f"push {number}" for number in motion.push[rows]]
    marks.append(Dots("before", points[:, 0], points[:, 1], titles, name="contacts"))
    near = points[np.max(np.abs(points), axis=1) < 3.0 * np.max(np.abs(every))]
    x, y = _equal(np.vstack([every, near]))
    label = "Contacts on the outline in the slider's frame"
    return Chart(label, "x, mm", "y, mm", x, y, tuple(marks), "Contacts on the outline", SQUARE)


def _equal(points: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    """Limits around points (n, 2) with one scale for both axes of a SQUARE chart with a title."""
    (x_low, x_high), (y_low, y_high) = limits_of(points[:, 0]), limits_of(points[:, 1])
    width, height = SQUARE[0] - LEFT - RIGHT, SQUARE[1] - TOP - LINE - BOTTOM
    scale = max((x_high - x_low) / width, (y_high - y_low) / height)
    half = 0.5 * scale * np.array([width, height])
    middle = 0.5 * np.array([x_low + x_high, y_low + y_high])
    (left, bottom), (right, top) = (middle - half).tolist(), (middle + half).tolist()
    return (left, right), (bottom, top)


def answer_of(checked: CheckedData) -> tuple[tuple[str, str, str], str]:
    """What was found, what to do, what was pushed; and a label: refused, check first, or sound."""
    worst = min(checked.findings, key=lambda finding: ORDER.index(finding.severity), default=None)
    label = "sound" if worst is None else LABELS[worst.severity]
    found, to_do, done = map(with_minus, (_found(checked, worst), _to_do(checked, worst), pushed(checked)))
    return (found, to_do, done), label


def with_minus(text: str) -> str:
    """The text with minus signs in place of the hyphens before numbers."""
    return re.sub(r"(?<![\w-])-(?=\d)", "\N{MINUS SIGN}", text)


def _found(checked: CheckedData, worst: Finding | None) -> str:
    if worst is None or worst.severity == "note":
        return "No mistake was found."
    if worst.severity == "refused":
        return f"These data cannot be used. {worst.sentence}"
    count = sum(finding.severity == "warning" for finding in checked.findings)
    return f"{'A mistake is' if count == 1 else f'{count} mistakes are'} probable. {worst.sentence}"


def _to_do(checked: CheckedData, worst: Finding | None) -> str:
    if worst is None:
        return "The data can be used as they are."
    if worst.severity == "note":
        return f"The data can be used as they are. To learn more: {worst.advice[0].lower()}{worst.advice[1:]}"
    return worst.advice


def pushed(checked: CheckedData) -> str:
    """What was pushed: sides, speeds and angles."""
    covered = checked.coverage
    return "Pushes are searched for once this is corrected." if covered is None else coverage_sentence(covered)


def contact_sentence(fit: ContactFit) -> str:
    """Where the contacts lie against the outline, and the share of their time that became windows."""
    inside, off = (f"{100.0 * share:.1f} %" for share in (fit.inside, fit.off))
    place = f"{inside} of the contacts are more than {1e3 * OFF:.0f} mm inside it, {off} as far outside."
    if fit.lost is None:
        return place
    return f"{place} Windows use {100.0 * (1.0 - fit.lost):.0f} % of the time in contact."


def coverage_sentence(coverage: Coverage) -> str:
    """The pushes, with sides, speeds, angles and the share of sliding contacts where they are known."""
    pushes = html.count(coverage.pushes, "push", "pushes")
    windows = html.count(coverage.windows, "window", "windows")
    counts = coverage.side_counts
    sides = "" if counts is None else f" on {np.count_nonzero(counts)} of {len(counts)} {coverage.side}s"
    slow, fast = (f"{1e3 * speed:.3g}" for speed in coverage.speeds)
    low, high = (f"{np.degrees(angle):.0f}" for angle in coverage.angles)
    sliding = coverage.sliding
    slides = "" if sliding is None else f" The contact slides in {100.0 * sliding:.0f} % of the steps."
    ranges = f"at {slow} to {fast} mm/s and {low} to {high} degrees"
    return f"The data contain {pushes} ({windows}){sides}, {ranges}.{slides}"
