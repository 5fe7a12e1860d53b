# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A rig corrected from the contacts of a recording, with the standard deviation of each estimate."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.errors import RecordingError
from push_predictor.geometry.shapes import mirror_image
from push_predictor.recordings.checks.check import check_recording
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.frames import contacts_of
from push_predictor.recordings.checks.outline.causes import Cause, cause_of, is_separate
from push_predictor.recordings.checks.outline.corrected_rig import corrected_rig, prevents_correction
from push_predictor.recordings.checks.outline.findings import fit_rig, value_of
from push_predictor.recordings.checks.outline.fit import WEAK, OutlineFit, fit_outline_and, fit_tip
from push_predictor.recordings.checks.outline.touches import LAG, SIZE, TIP, YAW, X, Y
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording

KNOWN = 0.5  # of the prior's sd: what the contacts do not determine keeps the prior's
UNKNOWN = "not determined by these contacts"


@dataclass(frozen=True)
class Row:
    """An estimate: name and key, unit of the JSON, factor and unit in the text, and the finding that corrects it."""

    name: str
    key: str
    parameter: int
    unit: str
    factor: float
    shown: str
    finding: str
    condition: str = ""


ROWS = (
    Row("yaw of the slider", "yaw", YAW, "rad", 180.0 / np.pi, "degrees", "outline_turned"),
    Row("shift along x", "x", X, "m", 1e3, "mm", "outline_shifted"),
    Row("shift along y", "y", Y, "m", 1e3, "mm", "outline_shifted"),
    Row("size", "size", SIZE, "1", 100.0, "%", "outline_size", ", if the tip radius is right"),
    Row("lag of the slider", "lag", LAG, "s", 1e3, "ms", "clocks_apart"),
    Row("tip radius", "tip_radius", TIP, "m", 1e3, "mm", "", ", if the size is right"),
)
SIZE_ROW, TIP_ROW = ROWS[3], ROWS[5]
TOGETHER = "size, tip radius"


@dataclass(frozen=True, eq=False)
class RigEstimate:
    """The corrected rig, and the findings of `check` with the given rig.

    cause: the correction of the given rig. with_size: with the tip's radius as given; with_tip: with the size as given;
    with_both: with neither.
    """

    given: Rig
    corrected: Rig
    cause: Cause
    with_size: OutlineFit
    with_tip: OutlineFit
    with_both: OutlineFit
    findings: tuple[Finding, ...]

    @property
    def fit(self) -> OutlineFit:
        """The correction of the given rig."""
        return self.cause.fit

    @property
    def lines(self) -> list[str]:
        """Each estimate with its standard deviation, and whether the rig was corrected by it; then the findings."""
        head = f"estimated from {self.fit.pushes} pushes, median gap {1e3 * self.fit.gap:.2f} mm after the correction:"
        found = [line for finding in self.findings for line in finding.lines]
        rows = [*map(self._line, ROWS), self._together()]
        return [head, *rows, *(["findings with the rig as given:", *found] if found else [])]

    def record(self) -> dict[str, object]:
        """The JSON of the estimates (SI units) and the findings; null where the contacts show nothing.

        size takes the tip's radius as given, tip_radius the size; size_and_tip_radius is null if the contacts do not
        separate the two.
        """
        estimates: dict[str, object] = {row.key: _record(self._value(row)) for row in ROWS}
        both = {"size": SIZE_ROW, "tip_radius": TIP_ROW}
        estimates["size_and_tip_radius"] = (
            {key: _record(self._of(self.with_both, row)) for key, row in both.items()} if self._separate else None
        )
        return {"estimates": estimates, "findings": [finding.record() for finding in self.findings]}

    @property
    def _separate(self) -> bool:
        return is_separate(self.with_both, self.given)

    @property
    def _corrected(self) -> set[str]:
        names = {finding.name for finding in self.findings}
        return names if self.cause.name != "tip_radius" else names - {SIZE_ROW.finding}

    def _value(self, row: Row) -> Value | None:
        """The estimate, None where the contacts show nothing."""
        fit = {SIZE: self.with_size, TIP: self.with_tip}.get(row.parameter, self.fit)
        value = self._of(fit, row)
        return value if 0.0 < (value.sd or 0.0) < KNOWN * float(WEAK[row.parameter]) else None

    def _of(self, fit: OutlineFit, row: Row) -> Value:
        offset = {SIZE: 1.0, TIP: self.given.pusher_radius}.get(row.parameter, 0.0)
        return value_of(fit, row.parameter, row.unit, offset)

    def _line(self, row: Row) -> str:
        if (value := self._value(row)) is None:
            return f"  {row.name:18s} {UNKNOWN}"
        if row.parameter == LAG:
            what = "not part of the rig" + (": correct the clocks" if row.finding in self._corrected else "")
        else:
            what = "corrected in the rig" if row.finding in self._corrected else "unchanged"
        return f"  {row.name:18s} {_shown(value, row)}{row.condition}: {what}"

    def _together(self) -> str:
        """Whether the contacts separate size and radius, and both where they do."""
        if not self._separate:
            return f"  {TOGETHER:18s} not separated by these contacts: measure both"
        size, radius = (_shown(self._of(self.with_both, row), row).strip() for row in (SIZE_ROW, TIP_ROW))
        what = "corrected in the rig" if self.cause.name == "tip_radius" else "unchanged"
        return f"  {TOGETHER:18s} {size} and {radius}, estimated together: {what}"


def _shown(value: Value, row: Row) -> str:
    number = round(row.factor * value.value, 2) + 0.0  # without a negative zero
    return f"{number:8.2f} {row.shown} (sd {row.factor * (value.sd or 0.0):.2g})"


def _record(value: Value | None) -> dict[str, object] | None:
    return None if value is None else {"value": value.value, "sd": value.sd, "unit": value.unit}


def estimate_rig(recording: Recording, rig: Rig) -> RigEstimate:
    """Correct a rig's outline or tip radius by what the contacts of a recording show beyond doubt.

    Raises RecordingError that names the findings with which nothing can be estimated, RigError for a size or radius
    that is not plausible.
    """
    findings = check_recording(recording, rig)
    if names := prevents_correction(findings):
        sentences = " ".join(finding.sentence for finding in findings if finding.name in names)
        raise RecordingError(f"{recording.name}: no rig can be estimated ({', '.join(names)}): {sentences}")
    corrected = corrected_rig(rig, findings)
    mirrored = any(finding.name == "outline_mirrored" for finding in findings)
    start = replace(rig, outline=mirror_image(rig.outline)) if mirrored else rig
    contacts = contacts_of(recording, start)
    if contacts is None:
        raise RecordingError(f"{recording.name}: no rig can be estimated, the recording contains no push")
    cause = cause_of(contacts, start, alone := fit_rig(contacts, start))
    first = alone if cause.name == "tip_radius" else cause.fit
    tip = fit_tip(start.outline, start.pusher_radius, contacts, first)
    both = fit_outline_and([TIP], start.outline, start.pusher_radius, contacts, first)
    return RigEstimate(rig, corrected, cause, first, tip, both, findings)
