# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Clocks: whether the stamps of the streams belong together, throughout the recording."""

from __future__ import annotations

from push_predictor.recordings.checks.evidence import Evidence


def clock_stage(evidence: Evidence) -> Evidence:
    """Whether the stamps of the streams belong together, throughout the recording."""
    return evidence
