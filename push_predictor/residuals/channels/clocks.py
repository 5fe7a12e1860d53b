# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Clocks that `check` found off: they are the measurement error, and what the windows show besides is not trusted."""

from __future__ import annotations

from collections.abc import Sequence

from scipy.special import ndtri
from scipy.stats import norm

from push_predictor.recordings.checks.finding import Finding, Value
from push_predictor.residuals.channels.contrast import ChannelEffect
from push_predictor.residuals.evidence.drivers import CONSTANT
from push_predictor.residuals.outcome import Sized

NAMES = ("clocks_apart", "clock_step", "clock_drift", "wrench_lag")  # findings of check about clocks
MECHANISM = "clock_offset"
MEANING = {
    "clocks_apart": "lateness of the slider's stamps",
    "clock_step": "step of the slider's stamps",
    "clock_drift": "drift of the slider's stamps",
    "wrench_lag": "lateness of the force's stamps",
}
UNTRUSTED = "A clock that is off changes windows and forces: effects on them are not trusted, and no model is extended."


def clock_errors(findings: Sequence[Finding]) -> tuple[ChannelEffect, ...]:
    """The clocks that are off, as measurement errors with their sizes."""
    return tuple(map(_error, findings))


def clock_notes(findings: Sequence[Finding]) -> tuple[str, ...]:
    """What was found about clocks, and that nothing is learnt from it."""
    return (*(finding.text for finding in findings), UNTRUSTED) if findings else ()


def _error(finding: Finding) -> ChannelEffect:
    size = next(iter(finding.values.values()), Value(0.0, "s"))
    half = float(ndtri(0.975)) * (size.sd or 0.0)
    sized = Sized(MEANING[finding.name], size.value, size.value - half, size.value + half, size.unit)
    p_value = 2.0 * float(norm.sf(abs(size.value) / size.sd)) if size.sd else 0.0
    return ChannelEffect(MECHANISM, CONSTANT, "constant", (sized,), p_value)
