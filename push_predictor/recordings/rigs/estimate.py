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

"""A rig corrected from the contacts of a recording, with the standard deviation of each estimate."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.errors import RecordingError
from push_predictor.geometry.shapes import mirror_image
from push_predictor.recordings.checks.check import check_recording
from push_predictor.recordings.checks.corrected_rig import corrected_rig, prevents_correction
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.checks.frames import contacts_of
from push_predictor.recordings.checks.outline_findings import fit_rig, with_tip
from push_predictor.recordings.checks.outline_fit import WEAK, OutlineFit
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording

ROWS = (  # name, key of the JSON, unit there, factor and unit in the text, finding that corrects it
    ("yaw of the slider", "yaw", "rad", 180.0 / np.pi, "degrees", "outline_turned"),
    ("shift along x", "x", "m", 1e3, "mm", "outline_shifted"),
    ("shift along y", "y", "m", 1e3, "mm", "outline_shifted"),
    ("size", "size", "1", 100.0, "%", "outline_size"),
    ("lag of the slider", "lag", "s", 1e3, "ms", "clocks_apart"),
    ("tip radius", "tip_radius", "m", 1e3, "mm", "tip_radius"),
)
LAG = 4
KNOWN = 0.5  # of the prior's sd: what the contacts do not determine keeps the prior's


@dataclass(frozen=True, eq=False)
class RigEstimate:
    """The corrected rig; fit: the correction of the given rig; findings: those of `check` with the given rig."""

    given: Rig
    corrected: Rig
    fit: OutlineFit
    findings: tuple[Finding, ...]

    @property
    def lines(self) -> list[str]:
        """Each estimate with its standard deviation, and whether the rig was corrected by it; then the findings."""
        names = {finding.name for finding in self.findings}
        head = f"estimated from {self.fit.pushes} pushes, median gap {1e3 * self.fit.gap:.2f} mm after the correction:"
        rows = [self._line(row, names) for row in range(len(ROWS))]
        found = [line for finding in self.findings for line in finding.lines]
        return [head, *rows, *(["findings with the rig as given:", *found] if found else [])]

    def record(self) -> dict[str, object]:
        """The JSON of the estimates (SI units) and the findings; null where the contacts show nothing."""
        estimates = {
            key: {"value": self._value(row), "sd": float(self.fit.sd[row]), "unit": unit} if self._known(row) else None
            for row, (_, key, unit, *_) in enumerate(ROWS)
        }
        return {"estimates": estimates, "findings": [finding.record() for finding in self.findings]}

    def _known(self, row: int) -> bool:
        return 0.0 < float(self.fit.sd[row]) < KNOWN * float(WEAK[row])

    def _value(self, row: int) -> float:
        given = {"size": 1.0, "tip_radius": self.given.pusher_radius}.get(ROWS[row][1], 0.0)
        return float(self.fit.estimate[row]) + given

    def _line(self, row: int, names: set[str]) -> str:
        name, _, _, factor, unit, finding = ROWS[row]
        if not self._known(row):
            fitted = float(self.fit.sd[row]) > 0.0
            return f"  {name:18s} {'not determined by these contacts' if fitted else 'taken as given'}"
        if row == LAG:
            what = "not part of the rig" + (": correct the clocks" if finding in names else "")
        else:
            what = "corrected in the rig" if finding in names else "unchanged"
        value = round(factor * self._value(row), 2) + 0.0  # without a negative zero
        return f"  {name:18s} {value:8.2f} {unit} (sd {factor * self.fit.sd[row]:.2g}): {what}"


def estimate_rig(recording: Recording, rig: Rig) -> RigEstimate:
    """Correct a rig's outline or tip radius by what the contacts of a recording show beyond doubt.

    Raises RecordingError that names the findings with which nothing can be estimated.
    """
    findings = check_recording(recording, rig)
    if names := prevents_correction(findings):
        sentences = " ".join(finding.sentence for finding in findings if finding.name in names)
        raise RecordingError(f"{recording.name}: no rig can be estimated ({', '.join(names)}): {sentences}")
    mirrored = any(finding.name == "outline_mirrored" for finding in findings)
    start = replace(rig, outline=mirror_image(rig.outline)) if mirrored else rig
    contacts = contacts_of(recording, start)
    if contacts is None:
        raise RecordingError(f"{recording.name}: no rig can be estimated, the recording contains no push")
    return RigEstimate(rig, corrected_rig(rig, findings), with_tip(contacts, start, fit_rig(contacts, start)), findings)
