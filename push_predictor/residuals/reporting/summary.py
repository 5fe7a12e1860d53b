"""A trace as a person reads it in a terminal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from push_predictor.evaluation.validation import Comparison, metrics_json
from push_predictor.reporting.html import NOTHING
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.wording import mechanism_words, verdict_sentence, worth_sentence


def summary_lines(trace: Trace) -> list[str]:
    """Verdict, worth, rivals, the held-out figures, what is left; plain ASCII."""
    lines = [f"{trace.verdict}: {verdict_sentence(trace)}", worth_sentence(trace), *_rivals(trace), *_held_out(trace)]
    if trace.remaining is not None:
        lines.append(f"still left: {trace.remaining}")
    lines += [f"note: {note}" for note in trace.notes]
    return [line.replace("−", "-").replace(NOTHING, "-") for line in lines]


def comparisons_of(trace: Trace) -> list[Comparison]:
    """before, refit and, where something was added, after: named so."""
    held = trace.held_out
    pairs = [("before", held.before), ("refit", held.refit), ("after", held.after)]
    shown = pairs if trace.terms or not _same(held.refit, held.after) else pairs[:2]
    return [replace(comparison, model=name) for name, comparison in shown]


def _same(one: Comparison, other: Comparison) -> bool:
    return np.array_equal(one.mean, other.mean) and np.array_equal(one.observed, other.observed)


def _rivals(trace: Trace) -> list[str]:
    names = [*trace.equivalent, *map(mechanism_words, trace.mechanisms)]
    return [f"these data cannot tell it from: {', '.join(names)}"] if names else []


def _held_out(trace: Trace) -> list[str]:
    head = f"held out: {len(trace.held_out.table.pushes)} pushes, sha256 {trace.held_out.digest}"
    titles = f"{'':8s}{'NMSE':>9s}{'NLPD':>10s}{'exact':>10s}{'cov90':>24s}"
    return [head, titles, *map(_line, comparisons_of(trace))]


def _line(comparison: Comparison) -> str:
    metrics: dict = metrics_json(comparison)
    exact = (metrics["exact_nlpd"] or {}).get("total")
    coverage = metrics["coverage"]["0.9"] or {}
    cells = [_cell(metrics["nmse"]["total"], 9), _cell(metrics["nlpd"]["total"], 10), _cell(exact, 10)]
    return f"{comparison.model:8s}{''.join(cells)}{''.join(_cell(share, 8) for share in coverage.values())}"


def _cell(value: float | None, width: int) -> str:
    return f"{'-':>{width}s}" if value is None else f"{value:{width}.3f}"
