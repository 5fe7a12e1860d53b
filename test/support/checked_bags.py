# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The recordings in bags/, and what `check` finds in a recording."""

from __future__ import annotations

from functools import cache

from lab_bags import short_recording, whole_recording

from push_predictor.recordings.checks.check import check_recording
from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import Recording


def bag(name: str) -> Recording:
    return whole_recording(name)


@cache
def sample(name: str) -> Recording:
    """A recording in bags/, of a long one its beginning with some 15 pushes: more change no finding."""
    return short_recording(30.0) if name == "square_abs_test" else bag(name)


def rig_of(name: str) -> Rig:
    rig = bag(name).rig
    assert rig is not None
    return rig


def found(recording: Recording, rig: Rig) -> dict[str, Finding]:
    return {finding.name: finding for finding in check_recording(recording, rig)}


def finding_of(name: str, **values: float) -> Finding:
    """A finding with these values."""
    return Finding(name, "warning", "", "", {key: Value(value, "1") for key, value in values.items()})
