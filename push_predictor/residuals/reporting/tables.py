# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of a trace's report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.metrics import nmse_reference
from push_predictor.evaluation.report.tables import metrics_tables
from push_predictor.evaluation.validation import Comparison, metrics_json
from push_predictor.recordings.table import OUTPUTS
from push_predictor.reporting import html
from push_predictor.residuals.outcome import FoundEffect, Tested, Trace
from push_predictor.residuals.reporting.phrases import (
    bare,
    count,
    covariate_phrase,
    effect_phrase,
    in_shown_unit,
    interval_cell,
    mechanism_phrase,
    p_text,
    shown_unit,
)
from push_predictor.residuals.reporting.sizes import SHOWN, shift_sizes

AT_ONCE = 15  # candidates shown before the reader opens the rest


def effects_table(trace: Trace) -> str:
    """The effects found, in the order of selection."""
    rows = [_effect_row(effect, trace.verdict == "variance") for effect in trace.effects]
    head = ("mechanism", "depends on", "parameter", "value", "outputs", "share", "p")
    caption = (
        "Effects found, in the order of selection. In brackets: 95 % intervals. Share: of the squared standardised "
        "residual of the analysis pushes. p: family-wise, over all candidates. Along a covariate, the value is the "
        "change over its range."
    )
    used = [k for k in range(len(head)) if any(row[k] != html.NOTHING for row in rows)]
    return html.folded_table(caption, [head[k] for k in used], [[row[k] for k in used] for row in rows])


def shifts_table(trace: Trace) -> str:
    """How far each effect shifts the outcome."""
    rows = []
    for effect, term in zip(trace.effects, trace.terms, strict=False):
        sizes = shift_sizes(trace, term, trace.analysis)
        cells = (interval_cell(sizes[name].times(SHOWN[name][0])) for name in OUTPUTS)
        rows.append([bare(effect_phrase(effect.mechanism, effect.covariate)), *cells])
    head = ("effect", "dx (mm)", "dy (mm)", "dtheta (deg)")
    caption = (
        "Shift of a window's outcome by each effect: root mean square over the analysis pushes. The 95 % intervals "
        "allow for dependence between neighbouring pushes."
    )
    return html.folded_table(caption, head, rows)


def tested_tables(trace: Trace) -> list[str]:
    """All candidates, smallest p first; all but fifteen are in a table of their own."""
    best = best_of(trace.tested)
    shown = _at_once(trace, best)
    rest = [tested for tested in best if tested not in shown]
    head = ("mechanism", "depends on", "family-wise p", "")
    caption = (
        f"{count(len(shown), 'pair', 'pairs')} of mechanism and covariate with the smallest p, of {len(best)}, each in "
        "its best basis, before any effect is subtracted. Neighbours of a true effect are often significant too, "
        "because covariates and responses correlate."
    )
    parts = [html.folded_table(caption, head, [_tested_row(trace, tested) for tested in shown])]
    if rest:
        title = f"The other {count(len(rest), 'pair', 'pairs')}"
        table = html.table(f"{title}.", head, [_tested_row(trace, tested) for tested in rest])
        parts.append(html.details(title, table))
    return parts


def held_out_table(trace: Trace) -> str:
    """Squared error, log density and coverage before, after the refit and with the effects."""
    head = ("model", "squared error (NMSE)", "NLPD (nats per window)", *(f"90 % coverage of {o}" for o in OUTPUTS))
    shown = trace.comparisons
    caption = (
        f"Held-out pushes. Squared error: 0 is perfect, 1 is no better than {nmse_reference(shown[0].n_train)}; summed "
        "over dx, dy and "
        "dtheta. NLPD: negative log predictive density, lower is better. Coverage: should be 90 %. In brackets: 95 % "
        "intervals."
    )
    return html.folded_table(caption, head, [_held_out_row(comparison) for comparison in shown])


def metric_tables(trace: Trace) -> list[str]:
    """The gain, and all metrics for each output before, after the refit and with the effects."""
    shown = trace.comparisons
    metrics = [metrics_json(comparison) for comparison in shown]
    alike = len({comparison.push_id.tobytes() for comparison in shown}) == 1
    tables = (
        metrics_tables(shown, metrics)
        if alike
        else [table for c, m in zip(shown, metrics, strict=True) for table in metrics_tables([c], [m])]
    )
    return [gain_table(trace), *tables] if trace.terms else tables


def gain_table(trace: Trace) -> str:
    """The gain of the extended model over the better of the two models without the effects."""
    other = "the deployed model" if trace.gain_over == "deployed" else "refit"
    rows = [
        ["total NMSE", interval_cell(trace.gain_nmse)],
        ["total NLPD (nats per window)", interval_cell(trace.gain_nlpd)],
    ]
    caption = (
        f"The gain: after minus {other} on the same held-out pushes; below zero is better. 95 % intervals are from a "
        "paired bootstrap of pushes. The reference is the better of the deployed model and the refit. Its predicted "
        "uncertainty is calibrated and contains that of the effects, so the gain counts only what the mean brings."
    )
    return html.folded_table(caption, ("", f"after minus {other}"), rows)


def detectable_table(trace: Trace) -> str:
    """The smallest detectable effects."""
    rows = []
    for name, size in trace.minimum_detectable.items():
        driven = size.get("driven")
        along = bare(covariate_phrase(str(driven["covariate"]))) if isinstance(driven, Mapping) else html.NOTHING
        cells = [_size_cell(size), _size_cell(driven) if isinstance(driven, Mapping) else html.NOTHING, along]
        rows.append([bare(mechanism_phrase(name)), *cells])
    caption = (
        "The smallest detectable effect of each mechanism: what the search finds with 80 % probability on these pushes "
        "at this level. Along a covariate the size is per standard deviation of the covariate."
    )
    return html.folded_table(caption, ("mechanism", "constant", "along a covariate", "covariate"), rows)


def _effect_row(effect: FoundEffect, noise: bool) -> list[str]:
    size, share = effect.parameter, effect.share_of_residual
    basis = "" if effect.basis == "constant" else f" ({effect.basis})"
    depends = "position on the table" if effect.basis == "map" else bare(covariate_phrase(effect.covariate))
    return [
        "noise" if noise else bare(mechanism_phrase(effect.mechanism)),
        f"{depends}{basis}",
        html.NOTHING if size is None else size.name.partition(", ")[0].partition(" over ")[0],
        html.NOTHING if size is None else interval_cell(*in_shown_unit(size)),
        ", ".join(name for name in OUTPUTS if name in effect.outputs) or html.NOTHING,
        f"{100.0 * share:.1f}\u00a0%" if np.isfinite(share) and share > 0.0 else html.NOTHING,
        p_text(effect.p_value),
    ]


def _held_out_row(comparison: Comparison) -> list[str]:
    metrics: dict[str, Any] = metrics_json(comparison)
    coverage = metrics["coverage"]["0.9"] or {}
    cells = [_with_interval(metrics, name) for name in ("nmse", "nlpd")]
    shares = (coverage.get(name) for name in OUTPUTS)
    return [comparison.model, *cells, *(html.NOTHING if s is None else f"{100.0 * s:.0f} %" for s in shares)]


def _with_interval(metrics: Mapping[str, Any], name: str) -> str:
    value, ends = metrics[name]["total"], metrics["interval"][name]
    if value is None or ends is None:
        return html.number(value, 3)
    return interval_cell(Estimate(value, ends["low"], ends["high"]))


def _at_once(trace: Trace, best: Sequence[Tested]) -> list[Tested]:
    """At most fifteen candidates: those that the answer names, then those with the smallest p."""
    named = [tested for tested in best if role_of(trace, tested)]
    others = [tested for tested in best if not role_of(trace, tested)]
    chosen = [*named, *others][:AT_ONCE]
    return [tested for tested in best if tested in chosen]


def _tested_row(trace: Trace, tested: Tested) -> list[str]:
    names = mechanism_phrase(tested.mechanism), covariate_phrase(tested.covariate)
    return [*map(bare, names), p_text(tested.p_value), _mark(trace, tested)]


def _size_cell(size: Mapping[str, Any]) -> str:
    value = size.get("value")
    factor, unit = shown_unit(str(size.get("unit", "")))
    return html.NOTHING if value is None else f"{_cell(factor * float(value))} {unit}".strip()


def _mark(trace: Trace, tested: Tested) -> str:
    role = role_of(trace, tested)
    if role:
        return role
    return "p below alpha" if tested.p_value <= trace.alpha else ""


def _cell(value: float | None) -> str:
    return html.number(value, 3) if value is not None and np.isfinite(value) else html.NOTHING


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
