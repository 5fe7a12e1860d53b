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

"""Check a recording or a push table before anything is learnt from it."""

from __future__ import annotations

from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.checks.frames import frame_findings
from push_predictor.recordings.checks.stamps import stamp_findings
from push_predictor.recordings.checks.units import quaternion_order, stream_units, table_units
from push_predictor.recordings.checks.wrench import wrench_findings
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable


def check_recording(recording: Recording, rig: Rig) -> tuple[Finding, ...]:
    """The probable mistakes of a recording, none if it is sound. Wrong units hide the other mistakes."""
    if wrong_units := stream_units(recording, rig):
        return tuple(wrong_units)
    frames = frame_findings(recording, rig)
    if turned := quaternion_order(recording.slider):
        # A tip has a constant heading too: the exchange of topics explains more.
        return tuple(frames) if any(finding.name == "topics_swapped" for finding in frames) else (turned,)
    if any(finding.severity == "refused" for finding in frames):
        return tuple(frames)
    return (*frames, *wrench_findings(recording, rig), *stamp_findings(recording))


def check_table(table: PushTable, rig: Rig | None = None) -> tuple[Finding, ...]:
    """The probable mistakes of a push table, none if it is sound."""
    return tuple(table_units(table, rig))
