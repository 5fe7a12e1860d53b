# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A recording or push table with all that was found about it: mistakes, and the coverage of the domain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from push_predictor.recordings.checks.check import check_table, evidence_of
from push_predictor.recordings.checks.coverage import Coverage, coverage_findings, coverage_of
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.checks.motion import ContactFit, contact_fit
from push_predictor.recordings.checks.table_signs import table_signs
from push_predictor.recordings.load import known_rig
from push_predictor.recordings.read import read_recording, require_rig
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import is_recording, read_table
from push_predictor.recordings.topics import Topics
from push_predictor.recordings.windows.finder import find_windows
from push_predictor.recordings.windows.push_window import PushWindow, windows_to_table

HIDING = ("wrench_absent", "wrench_unrelated")  # a force that is missing in contacts: these are not found


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
