# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Data of a recording that are missing or cannot be read."""

from __future__ import annotations

from push_predictor.recordings.checks.evidence import Evidence
from push_predictor.recordings.checks.finding import Finding, Value

LISTED = 3  # losses that are stated; `info` lists all
ADVICE = (
    "Copy missing files into the folder, or record again: the pushes in them are not used. `push_predictor info` lists "
    "all notes."
)


def loss_stage(evidence: Evidence) -> Evidence:
    """What the reader had to leave out. All that follows holds for the rest."""
    losses = evidence.recording.losses
    if not losses:
        return evidence
    further = f" There are {len(losses) - LISTED} further losses." if len(losses) > LISTED else ""
    sentence = f"Data of the recording are missing: {'; '.join(losses[:LISTED])}.{further}"
    values = {"losses": Value(float(len(losses)), "1")}
    return evidence.found([Finding("data_lost", "warning", sentence, ADVICE, values)])
