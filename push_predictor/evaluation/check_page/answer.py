# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The three sentences that begin the page of a check."""

from __future__ import annotations

import re

import numpy as np

from push_predictor.recordings.checks.checked import CheckedData
from push_predictor.recordings.checks.coverage import Coverage
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.checks.motion import OFF, ContactFit

ORDER = ("refused", "warning", "note")
LABELS = {"refused": "refused", "warning": "check first", "note": "sound"}


def answer_of(checked: CheckedData) -> tuple[tuple[str, str, str], str]:
    """What was found, what to do, what was pushed; and a label: refused, check first, or sound."""
    worst = min(checked.findings, key=lambda finding: ORDER.index(finding.severity), default=None)
    label = "sound" if worst is None else LABELS[worst.severity]
    sentences = _found(checked, worst), _to_do(checked, worst), pushed(checked)
    found, to_do, done = map(with_minus, sentences)
    return (found, to_do, done), label


def with_minus(text: str) -> str:
    """The text with minus signs in place of the hyphens before numbers."""
    return re.sub(r"(?<![\w-])-(?=\d)", "\N{MINUS SIGN}", text)


def _found(checked: CheckedData, worst: Finding | None) -> str:
    if worst is None or worst.severity == "note":
        return "No mistake was found."
    if worst.severity == "refused":
        return f"These data cannot be used. {worst.sentence}"
    count = sum(finding.severity == "warning" for finding in checked.findings)
    return f"{'A mistake is' if count == 1 else f'{count} mistakes are'} probable. {worst.sentence}"


def _to_do(checked: CheckedData, worst: Finding | None) -> str:
    if worst is None:
        return "The data can be used as they are."
    if worst.severity == "note":
        return f"The data can be used as they are. To learn more: {worst.advice[0].lower()}{worst.advice[1:]}"
    return worst.advice


def pushed(checked: CheckedData) -> str:
    """What was pushed: sides, speeds and angles."""
    if checked.coverage is None:
        return "Pushes are searched for once this is corrected."
    return coverage_sentence(checked.coverage)


def contact_sentence(fit: ContactFit) -> str:
    """Where the contacts lie against the outline, and the share of their time that became windows."""
    inside, off = (f"{100.0 * share:.1f} %" for share in (fit.inside, fit.off))
    place = f"{inside} of the contacts are more than {1e3 * OFF:.0f} mm inside it, {off} as far outside."
    if fit.lost is None:
        return place
    return f"{place} Windows use {100.0 * (1.0 - fit.lost):.0f} % of the time in contact."


def coverage_sentence(coverage: Coverage) -> str:
    """The pushes, with sides, speeds, angles and the share of sliding contacts where they are known."""
    pushes = f"{coverage.pushes} push{'' if coverage.pushes == 1 else 'es'}"
    windows = f"{coverage.windows} window{'' if coverage.windows == 1 else 's'}"
    counts = coverage.side_counts
    sides = "" if counts is None else f" on {np.count_nonzero(counts)} of {len(counts)} {coverage.side}s"
    slow, fast = (f"{1e3 * speed:.3g}" for speed in coverage.speeds)
    low, high = (f"{np.degrees(angle):.0f}" for angle in coverage.angles)
    sliding = coverage.sliding
    slides = "" if sliding is None else f" The contact slides in {100.0 * sliding:.0f} % of the steps."
    ranges = f"at {slow} to {fast} mm/s and {low} to {high} degrees"
    return f"The data contain {pushes} ({windows}){sides}, {ranges}.{slides}"
