# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Check recordings and push tables before anything is learnt from them.

The stages are asked in order: losses, streams, frames, clocks, geometry, force; the coverage of the windows follows.
Each works on what the stages before have accepted, and leaves out what their findings explain.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from push_predictor.errors import RecordingError
from push_predictor.recordings.checks.clocks import clock_stage
from push_predictor.recordings.checks.coverage import (
    ContactFit,
    Coverage,
    contact_fit,
    coverage_findings,
    coverage_of,
    pushed_part,
)
from push_predictor.recordings.checks.finding import Evidence, Finding, Value
from push_predictor.recordings.checks.force import force_stage
from push_predictor.recordings.checks.frames import frame_stage
from push_predictor.recordings.checks.geometry import geometry_stage
from push_predictor.recordings.checks.streams import stream_stage
from push_predictor.recordings.checks.units import check_table, table_signs
from push_predictor.recordings.load import known_rig
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import is_recording, read_table
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import PushWindow, windows_to_table

LISTED = 3  # losses that are stated; `info` lists all
ADVICE = (
    "Copy missing files into the folder, or record again: the pushes in them are not used. `push_predictor info` lists "
    "all notes."
)
HIDING = ("wrench_absent", "wrench_unrelated")  # a force that is missing in contacts: these are not found


def check_recording(recording: Recording, rig: Rig) -> tuple[Finding, ...]:
    """The probable mistakes of a recording, none if it is sound."""
    return evidence_of(recording, rig).findings


def evidence_of(recording: Recording, rig: Rig) -> Evidence:
    """What the stages know of a recording: its probable mistakes, and what they found on the way."""
    evidence = Evidence(recording, rig, recorded=recording)
    for stage in (loss_stage, stream_stage, frame_stage, clock_stage, geometry_stage, force_stage):
        evidence = stage(evidence)
        if evidence.refused:
            break
    return evidence


def loss_stage(evidence: Evidence) -> Evidence:
    """What the reader had to leave out. All that follows holds for the rest."""
    losses = evidence.recording.losses
    if not losses:
        return evidence
    sentence = f"Data of the recording are missing (losses: {len(losses)}): {'; '.join(losses[:LISTED])}."
    values = {"losses": Value(float(len(losses)), "1")}
    return evidence.found([Finding("data_lost", "warning", sentence, ADVICE, values)])


# --- recordings and tables with all that was found about them ---------------------------------------------------------


@dataclass(frozen=True, eq=False)
class CheckedData:
    """Findings about mistakes first, then about coverage. recording: None for a push table.

    coverage and table (of windows): None for refused data; coverage also without a push. rig: None for a table without
    one. contacts: None for a table, and for a recording without contact.
    """

    name: str
    findings: tuple[Finding, ...]
    coverage: Coverage | None
    recording: Recording | None
    rig: Rig | None
    table: PushTable | None = None
    contacts: ContactFit | None = None

    @property
    def refused(self) -> bool:
        """Whether nothing can be learnt from these data."""
        return any(finding.severity == "refused" for finding in self.findings)


def checked_data(path: Path, rig: Rig | None = None, topics: Topics = Topics()) -> CheckedData:
    """Check the recording or push table of a path. Raises RecordingError, TableError or RigError."""
    if not is_recording(path):
        return _checked_table(path.name, read_table(path), rig or known_rig(path))
    return checked_recording(read_recording(path, rig=rig, topics=topics))


def checked_recording(recording: Recording) -> CheckedData:
    """Check a recording, and the coverage of its windows if nothing is refused. Raises RigError without a rig."""
    rig = require_rig(recording)
    evidence = evidence_of(recording, rig)
    found, motion = evidence.findings, evidence.motion_as_recorded
    if evidence.refused:
        return CheckedData(recording.name, found, None, recording, rig, contacts=contact_fit(motion, rig))
    windows = evidence.windows
    if windows is None:
        windows = find_windows(recording, rig)
    if any(finding.name in HIDING for finding in found):
        some, windows = windows, find_windows(replace(recording, wrench=None), rig)
        found = _with_hidden(found, _pushes(some), _pushes(windows))
    table = windows_to_table(windows)
    if all(finding.severity == "note" for finding in found):
        found = (*found, *table_signs(table, rig))  # of a circle, contacts do not show the sign of the heading
    coverage = coverage_of(table, rig)
    fit = contact_fit(motion, rig, table)
    return CheckedData(recording.name, (*found, *coverage_findings(coverage)), coverage, recording, rig, table, fit)


def _with_hidden(found: Sequence[Finding], some: int, every: int) -> tuple[Finding, ...]:
    """The findings about a useless wrench with the remedy, and with the numbers of pushes if it hides some."""
    hides = f" With this wrench, contact is found in {some} of {every} pushes." if some < every else ""
    hides += " `--wrench-topic none` does without it."
    return tuple(replace(each, advice=each.advice + hides) if each.name in HIDING else each for each in found)


def _pushes(windows: Sequence[PushWindow]) -> int:
    return len({window.push_id for window in windows})


def _checked_table(name: str, table: PushTable, rig: Rig | None) -> CheckedData:
    found = check_table(table, rig)
    if any(finding.severity == "refused" for finding in found):
        return CheckedData(name, found, None, None, rig)
    coverage = coverage_of(table, rig)
    return CheckedData(name, (*found, *coverage_findings(coverage)), coverage, None, rig, table)


# --- where data enter: train, evaluate, validate, trace, from commands or Python --------------------------------------


class DataChecks:
    """Checks each recording or table as it is read: pass it as `inspect` to what reads the data.

    report: called with each warning, once. Raises RecordingError for refused data; strict: for a warning too. Notes
    are left to `push_predictor check`.
    """

    def __init__(self, strict: bool, report: Callable[[str], None]) -> None:
        self._failing = ("refused", "warning") if strict else ("refused",)
        self._report = report
        self._reported: set[str] = set()
        self._found: list[Finding] = []

    def __call__(self, path: Path, data: Recording | PushTable, rig: Rig | None) -> None:
        """Check what was read from a path."""
        if isinstance(data, PushTable):
            self._judge([path], check_table(data, rig))
        else:
            self._judge([path], check_recording(data, rig or require_rig(data)))

    def learnt_from(self, paths: Iterable[Path], table: PushTable, rig: Rig) -> None:
        """Check that the pushes of all paths together suffice for a learnt model."""
        self._judge(paths, coverage_findings(coverage_of(table, rig)))

    def judged_by(self, paths: Iterable[Path], table: PushTable, rig: Rig | None) -> None:
        """Check which part of the domain the pushes of all paths cover: a model is judged on that part only."""
        self._judge(paths, pushed_part(table, rig))

    def found(self, *names: str) -> tuple[Finding, ...]:
        """The findings of these names so far, in order."""
        return tuple(finding for finding in self._found if finding.name in names)

    def _judge(self, paths: Iterable[Path], findings: Sequence[Finding]) -> None:
        self._found += findings
        name = ", ".join(map(str, paths))
        if wrong := [finding.text for finding in findings if finding.severity in self._failing]:
            raise RecordingError(f"{name}: {' '.join(wrong)}")
        for line in (f"{name}: {finding.text}" for finding in findings if finding.severity == "warning"):
            if line not in self._reported:
                self._reported.add(line)
                self._report(line)
