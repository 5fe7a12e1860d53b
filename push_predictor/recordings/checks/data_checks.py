# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The checks of `push_predictor check` where data enter: train, evaluate, validate, trace, from commands or Python."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from push_predictor.errors import RecordingError
from push_predictor.recordings.checks.check import check_recording, check_table
from push_predictor.recordings.checks.coverage import coverage_findings, coverage_of, pushed_part
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.read import require_rig
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable


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
