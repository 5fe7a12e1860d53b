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

"""The checks of `push_predictor check` inside the commands that read data: warnings on stderr, refusals as errors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from push_predictor.commands.common.output import warn
from push_predictor.errors import RecordingError

if TYPE_CHECKING:
    from push_predictor.recordings.checks.finding import Finding
    from push_predictor.recordings.rig import Rig
    from push_predictor.recordings.streams import Recording
    from push_predictor.recordings.table import PushTable


class DataChecks:
    """Checks each recording or table as it is read: pass it as `inspect` to what reads the data.

    Prints each warning once. Raises RecordingError for refused data; strict: for a warning too. Notes are left to
    `push_predictor check`.
    """

    def __init__(self, strict: bool) -> None:
        self._failing = ("refused", "warning") if strict else ("refused",)
        self._printed: set[str] = set()

    def __call__(self, path: Path, data: Recording | PushTable, rig: Rig | None) -> None:
        """Check what was read from a path."""
        from push_predictor.recordings.checks.check import check_recording, check_table
        from push_predictor.recordings.read import require_rig
        from push_predictor.recordings.table import PushTable

        if isinstance(data, PushTable):
            self._judge(str(path), check_table(data, rig))
        else:
            self._judge(str(path), check_recording(data, rig or require_rig(data)))

    def coverage(self, paths: Iterable[Path], table: PushTable, rig: Rig) -> None:
        """Check that the pushes of all paths together suffice for a learnt model."""
        from push_predictor.recordings.checks.coverage import coverage_findings, coverage_of

        coverage = coverage_of(table, rig.outline, rig.pusher_radius)
        self._judge(", ".join(map(str, paths)), coverage_findings(coverage))

    def _judge(self, name: str, findings: Sequence[Finding]) -> None:
        if wrong := [finding.text for finding in findings if finding.severity in self._failing]:
            raise RecordingError(f"{name}: {' '.join(wrong)}")
        for line in (f"{name}: {finding.text}" for finding in findings if finding.severity == "warning"):
            if line not in self._printed:
                self._printed.add(line)
                warn(line)
