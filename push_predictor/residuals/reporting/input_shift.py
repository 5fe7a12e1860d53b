# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The inputs that differ from those of training: which, from where to where, and for which share of the windows."""

from __future__ import annotations

from typing import Any

from push_predictor.reporting.html import number
from push_predictor.residuals.evidence.input_shift import ShiftedInput
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.phrases import covariate_phrase, shown_unit_of


def input_shift_json(trace: Trace) -> list[dict[str, Any]]:
    """The shifts as the JSON of a trace lists them."""
    return [
        {
            "covariate": shift.covariate,
            "training": [float(end) for end in shift.training],
            "now": [float(end) for end in shift.now],
            "share_outside": float(shift.share_outside),
            "share_unvisited": float(shift.share_unvisited),
        }
        for shift in trace.input_shift
    ]


def shift_clause(shift: ShiftedInput) -> str:
    """Where a covariate is now and where it was in training, in one clause."""
    factor, unit = shown_unit_of(shift.covariate)
    now, before = (_range(ends, factor, unit) for ends in (shift.now, shift.training))
    return f"{covariate_phrase(shift.covariate)} is now {now}, in training {before}"


def share_clause(shift: ShiftedInput) -> str:
    """The share of windows outside, or of those of training that the new ones leave out."""
    if not shift.extrapolates:
        return f"{100.0 * shift.share_unvisited:.0f} % of the training windows lie outside the range of the new pushes"
    return f"{100.0 * shift.share_outside:.0f} % of the windows lie outside the range of training"


def _range(ends: tuple[float, float], factor: float, unit: str) -> str:
    return f"{number(factor * float(ends[0]), 3)} to {number(factor * float(ends[1]), 3)} {unit}".rstrip()
