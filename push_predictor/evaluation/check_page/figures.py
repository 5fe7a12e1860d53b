# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The figures of a check: tracks from above, contacts in the slider's frame, pushes by speed, angle and side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, to_body
from push_predictor.recordings.checks.checked import CheckedData
from push_predictor.recordings.checks.coverage import Coverage
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.checks.motion import Motion, motion_of
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
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

MOST_POINTS = 1500  # of a track
MOST_CONTACTS = 700
MOST_PUSHES = 600  # dots
SQUARE = (460.0, 430.0)  # pixels
MM = 1e3


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
    return None if motion is None else _tracks(motion)


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


def _tracks(motion: Motion) -> Chart:
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
