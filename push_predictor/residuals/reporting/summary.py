# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A trace as a person reads it in a terminal."""

from __future__ import annotations

from typing import Any

from push_predictor.evaluation.validation import Comparison, metrics_json
from push_predictor.reporting.html import NOTHING
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.phrases import effect_phrase
from push_predictor.residuals.reporting.rivals import advice, rivals
from push_predictor.residuals.reporting.sentences import answer, evidence, worth


def summary_lines(trace: Trace) -> list[str]:
    """The page's answer, its evidence, held-out figures and notes; plain ASCII."""
    details = filter(None, (evidence(trace), rivals(trace), *advice(trace), worth(trace)))
    lines = [*answer(trace), "", *details, "", *_held_out(trace)]
    if trace.remaining is not None:
        lines.append(f"Still significant after these effects: {effect_phrase(*trace.remaining)}.")
    lines += [f"Note: {note}" for note in trace.notes]
    return [line.replace("−", "-").replace(NOTHING, "-") for line in lines]


def _held_out(trace: Trace) -> list[str]:
    head = f"Held out: {len(trace.held_out.table.pushes)} pushes, SHA-256 {trace.held_out.digest}"
    titles = f"{'':8s}{'NMSE':>9s}{'NLPD':>10s}{'exact NLPD':>12s}{'90 % coverage, dx dy dtheta':>30s}"
    return [head, titles, *map(_line, trace.comparisons)]


def _line(comparison: Comparison) -> str:
    metrics: dict[str, Any] = metrics_json(comparison)
    exact = (metrics["exact_nlpd"] or {}).get("total")
    coverage = metrics["coverage"]["0.9"] or {}
    cells = [_cell(metrics["nmse"]["total"], 9), _cell(metrics["nlpd"]["total"], 10), _cell(exact, 12)]
    return f"{comparison.model:8s}{''.join(cells)}{''.join(_cell(share, 10) for share in coverage.values())}"


def _cell(value: float | None, width: int) -> str:
    return f"{'-':>{width}s}" if value is None else f"{value:{width}.3f}"
