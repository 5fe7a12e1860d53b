# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Check a recording or a push table before anything is learnt from it.

The stages are asked in order: losses, streams, frames, clocks, geometry, force; the coverage of the windows follows in
checked.py. Each works on what the stages before have accepted, and leaves out what their findings explain.
"""

from __future__ import annotations

from push_predictor.recordings.checks.clocks.stage import clock_stage
from push_predictor.recordings.checks.evidence import Evidence
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.checks.force.stage import force_stage
from push_predictor.recordings.checks.frames.stage import frame_stage
from push_predictor.recordings.checks.geometry.stage import geometry_stage
from push_predictor.recordings.checks.streams.stage import stream_stage
from push_predictor.recordings.checks.table_signs import table_signs
from push_predictor.recordings.checks.units import table_units
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable

LISTED = 3  # losses that are stated; `info` lists all
ADVICE = (
    "Copy missing files into the folder, or record again: the pushes in them are not used. `push_predictor info` lists "
    "all notes."
)


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
    further = f" There are {len(losses) - LISTED} further losses." if len(losses) > LISTED else ""
    sentence = f"Data of the recording are missing: {'; '.join(losses[:LISTED])}.{further}"
    values = {"losses": Value(float(len(losses)), "1")}
    return evidence.found([Finding("data_lost", "warning", sentence, ADVICE, values)])


def check_table(table: PushTable, rig: Rig | None = None) -> tuple[Finding, ...]:
    """The probable mistakes of a push table, none if it is sound."""
    return tuple(table_units(table, rig) or table_signs(table, rig))
