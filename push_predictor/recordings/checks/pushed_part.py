# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What pushes leave out of the domain, where they judge a model: scores say nothing about the rest."""

from __future__ import annotations

from push_predictor.recordings.checks.coverage import Coverage, coverage_findings, coverage_of
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable

MEANING = "The results are valid only for the part of the domain that was pushed."


def pushed_part(table: PushTable, rig: Rig | None = None) -> list[Finding]:
    """A warning that states what a table of windows leaves out of the domain; none if it covers enough.

    The limits are those of the warnings of `push_predictor check`. Sides and sliding contacts need the rig.
    """
    coverage = coverage_of(table) if rig is None else coverage_of(table, rig.outline, rig.pusher_radius)
    if coverage is None:
        return []
    lacking = [finding for finding in coverage_findings(coverage) if finding.severity == "warning"]
    sentences = [_sentence(finding, coverage) for finding in lacking]
    return [Finding("pushed_part", "warning", " ".join(sentences), MEANING)] if sentences else []


def _sentence(finding: Finding, coverage: Coverage) -> str:
    """The sentence of a finding, without what a learnt model needs."""
    if finding.name != "few_pushes":
        return finding.sentence
    return f"The data contain {coverage.pushes} push{'' if coverage.pushes == 1 else 'es'} only."
