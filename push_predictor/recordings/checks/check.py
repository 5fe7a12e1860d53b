# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Check a recording or a push table before anything is learnt from it."""

from __future__ import annotations

from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.checks.fixed_to_tip import fixed_to_tip
from push_predictor.recordings.checks.frames import frame_findings, tip_follows
from push_predictor.recordings.checks.stamps import stamp_findings
from push_predictor.recordings.checks.table_signs import table_signs
from push_predictor.recordings.checks.units import orientation_finding, stream_units, table_units
from push_predictor.recordings.checks.wrench import wrench_findings
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable


def check_recording(recording: Recording, rig: Rig) -> tuple[Finding, ...]:
    """The probable mistakes of a recording, none if it is sound. Wrong units hide the other mistakes."""
    if wrong_units := stream_units(recording, rig):
        return tuple(wrong_units)
    if held := fixed_to_tip(recording, rig):
        return (held,)
    oriented = orientation_finding(recording.slider)
    # A tip has a constant heading too: the exchange of topics explains more.
    if oriented is not None and oriented.severity == "refused" and not tip_follows(recording, rig):
        return (oriented,)
    frames = frame_findings(recording, rig)
    if any(finding.name == "topics_swapped" for finding in frames):
        return tuple(frames)
    if oriented is not None and oriented.severity == "refused":
        return (oriented,)
    if any(finding.severity == "refused" for finding in frames):
        return tuple(frames)
    found = frames if oriented is None else [oriented, *frames]
    outlined = all(finding.severity == "note" for finding in found)
    return (*found, *wrench_findings(recording, rig, outlined), *stamp_findings(recording))


def check_table(table: PushTable, rig: Rig | None = None) -> tuple[Finding, ...]:
    """The probable mistakes of a push table, none if it is sound."""
    return tuple(table_units(table, rig) or table_signs(table, rig))
