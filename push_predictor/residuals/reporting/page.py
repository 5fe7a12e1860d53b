# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A trace as one self-contained HTML page: the answer first, then its evidence, then data and method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from push_predictor.errors import PushPredictorError
from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.metrics import nmse_reference
from push_predictor.evaluation.report.tables import metrics_tables
from push_predictor.evaluation.validation import Comparison, metrics_json
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.table import OUTPUTS
from push_predictor.reporting import html
from push_predictor.residuals.evidence.split import RULE
from push_predictor.residuals.outcome import FoundEffect, Tested, Trace
from push_predictor.residuals.reporting.figures.gallery import effect_figures, error_figure, key_figure
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
from push_predictor.residuals.reporting.sentences import advice, answer, evidence, rivals, shift_sentence, worth

VERDICTS = {
    "none": "no change found",
    "effect": "effect named",
    "driver_only": "mechanism unknown",
    "mechanism_only": "cause undecided",
    "wrench_only": "force only",
    "measurement": "measurement error",
    "variance": "noise only",
    "input_shift": "inputs shifted",
}
WEAK = "weak evidence"
KINDS = {"vhgp": "variational heteroscedastic GP", "gp": "standard GP", "analytical": "analytical model"}
UNNAMED = (
    "A mechanism is named only if it explains nearly as much as a general pattern over contact point and push angle. "
    "Here no mechanism does. A tested mechanism can be significant because it resembles the pattern."
)


def write_trace_report(path: Path, trace: Trace) -> Path:
    """Write the page; return its path. Raises OSError, or PushPredictorError if a part of it fails."""
    path = Path(path)
    try:
        page = html.page(f"Trace of the model {trace.model.name}", _parts(trace))
    except (OSError, PushPredictorError):
        raise
    except Exception as error:  # a picture must not cost the caller the verdict
        raise PushPredictorError(f"{path}: the report could not be drawn ({type(error).__name__}: {error})") from error
    write_whole(path, page.encode())
    return path


def _parts(trace: Trace) -> list[str]:
    return [
        html.opening(answer(trace), WEAK if trace.weak else VERDICTS[trace.verdict], html.joined(key_figure(trace))),
        *_shifted_inputs(trace),
        *_held_out(trace),
        *_rivals(trace),
        *_effects(trace),
        *_tested(trace),
        *_remaining(trace),
        *([html.heading("Notes"), html.bullets(trace.notes)] if trace.notes else []),
        html.heading("Data and method"),
        html.definitions(_facts(trace)),
    ]


def _facts(trace: Trace) -> dict[str, str]:
    model, held = trace.model, trace.held_out
    trained = count(model.provenance.pushes, "training push", "training pushes")
    analysis = count(len(trace.analysis.pushes), "push", "pushes")
    held_out = count(len(held.table.pushes), "push", "pushes")
    kind = KINDS.get(model.kind, model.kind)
    return {
        "model": f"{model.name}: {kind}, slider {model.rig.shape} on {model.rig.surface}, {trained}",
        "analysis": f"{analysis}, {len(trace.analysis)} windows of {float(np.median(trace.analysis.duration)):.2g} s",
        "held out": f"{held_out}, {len(held.table)} windows, opened once, after every choice was made",
        "split": f"by push: {RULE}",
        "held-out SHA-256": held.digest,
        "family-wise level": f"{trace.alpha:g}: the probability of any false alarm if nothing changed",
        "motion model": "extended" if trace.extended is not None else "unchanged",
    }


def _shifted_inputs(trace: Trace) -> list[str]:
    """Inputs that differ from those of training, where they are not the verdict itself."""
    shifts = () if trace.verdict == "input_shift" else trace.input_shift
    return [html.paragraph(shift_sentence(shift), "warning") for shift in shifts]


def _effects(trace: Trace) -> list[str]:
    if not trace.effects:
        return []
    heading = html.heading("The effect" if len(trace.effects) == 1 else "The effects")
    parts = [heading, html.paragraph(evidence(trace)), effects_table(trace)]
    return [*parts, *effect_figures(trace)]


def _rivals(trace: Trace) -> list[str]:
    if not trace.effects:
        return []
    parts = [html.heading("Rival explanations, and pushes that would decide"), html.paragraph(_rivals_sentence(trace))]
    if trace.verdict == "driver_only":
        parts.append(html.paragraph(UNNAMED))
    return [*parts, html.bullets(advice(trace))] if trace.equivalent else parts


def _rivals_sentence(trace: Trace) -> str:
    if not trace.equivalent and not trace.mechanisms:
        return "No other candidate explains these pushes as well."
    decided = (
        "These data do not decide"
        if trace.undecided
        else "The first fits best, but these data do not exclude the others"
    )
    return f"{rivals(trace)} {decided}."


def _held_out(trace: Trace) -> list[str]:
    method = (
        f"{_after(trace)} All figures are of pushes that took no part in the search. Before: the deployed model. "
        "Refit: the same model retrained on the analysis pushes, without the effect. Of an analytical model only the "
        "covariance is estimated again."
    )
    every = [html.paragraph(method), *metric_tables(trace)]
    parts = [html.heading("Before, refit, after"), html.paragraph(worth(trace)), held_out_table(trace)]
    return [*parts, *error_figure(trace), html.details("All metrics", html.joined(every))]


def _after(trace: Trace) -> str:
    if trace.terms:
        return "After: the refit with the effects found."
    if trace.verdict == "measurement":
        return "After: the deployed model, unchanged, on windows cut again from corrected recordings, if there are any."
    return "Nothing was added, so there is no model after the refit."


def _tested(trace: Trace) -> list[str]:
    parts = [html.heading("What else was tested")]
    if not trace.tested:
        return [*parts, html.paragraph("Nothing could be tested: see the notes.", "warning")]
    closest = [] if trace.effects else [html.paragraph(evidence(trace))]
    return [*parts, *closest, tested_table(trace)]


def _remaining(trace: Trace) -> list[str]:
    parts = [
        html.heading("What remains, and what could have been missed"),
        html.paragraph(_remaining_sentence(trace)),
    ]
    if not trace.minimum_detectable:
        return [*parts, html.paragraph("The smallest detectable effect was not determined.")]
    return [*parts, detectable_table(trace)]


def _remaining_sentence(trace: Trace) -> str:
    if trace.verdict == "measurement":
        return "The motion was not searched. Correct the measurement first, record or cut again, then trace again."
    if not trace.effects:
        return "No effect was found, so nothing was subtracted."
    if trace.remaining is None:
        return "In what the effects leave, the search finds nothing more."
    strongest = effect_phrase(*trace.remaining)
    return f"Something remains after the effects found are subtracted. The strongest candidate is {strongest}."


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


def tested_table(trace: Trace) -> str:
    """All candidates, smallest p first."""
    best = best_of(trace.tested)
    caption = (
        f"{count(len(best), 'pair', 'pairs')} of mechanism and covariate, each in its best basis, before any effect is "
        "subtracted. Neighbours of a true effect are often significant too, because covariates and responses correlate."
    )
    head = ("mechanism", "depends on", "family-wise p", "")
    return html.folded_table(caption, head, [_tested_row(trace, tested) for tested in best])


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
    """All metrics for each output before, after the refit and with the effects."""
    shown = trace.comparisons
    metrics = [metrics_json(comparison) for comparison in shown]
    if len({comparison.push_id.tobytes() for comparison in shown}) == 1:
        return metrics_tables(shown, metrics)
    return [table for c, m in zip(shown, metrics, strict=True) for table in metrics_tables([c], [m])]


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


def _tested_row(trace: Trace, tested: Tested) -> list[str]:
    names = mechanism_phrase(tested.mechanism), covariate_phrase(tested.covariate)
    mark = role_of(trace, tested) or ("p below alpha" if tested.p_value <= trace.alpha else "")
    return [*map(bare, names), p_text(tested.p_value), mark]


def _size_cell(size: Mapping[str, Any]) -> str:
    value = size.get("value")
    factor, unit = shown_unit(str(size.get("unit", "")))
    return html.NOTHING if value is None else f"{_cell(factor * float(value))} {unit}".strip()


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
