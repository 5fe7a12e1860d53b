# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The candidates of a trace: the best of each pair of mechanism and covariate, and its role in the answer."""

from __future__ import annotations

from collections.abc import Sequence

from push_predictor.residuals.outcome import Tested, Trace


def best_of(tested: Sequence[Tested]) -> list[Tested]:
    """One candidate for each mechanism and covariate, that with the smallest p; the smallest first."""
    best: dict[tuple[str | None, str], Tested] = {}
    for each in sorted(tested, key=lambda t: t.p_value):
        best.setdefault((each.mechanism, each.covariate), each)
    return list(best.values())


def role_of(trace: Trace, tested: Tested) -> str:
    """The role of a candidate: "found", "rival" (of the first effect) or ""."""
    if any((tested.mechanism, tested.covariate) == (e.mechanism, e.covariate) for e in trace.effects):
        return "found"
    if not trace.effects:
        return ""
    first = trace.effects[0]
    covariate = tested.covariate in (first.covariate, *trace.equivalent)
    mechanism = tested.mechanism in (first.mechanism, *trace.mechanisms)
    return "rival" if covariate and mechanism else ""
