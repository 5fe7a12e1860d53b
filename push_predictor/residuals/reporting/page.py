# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A trace as one self-contained HTML page: the answer first, then its evidence, then data and method."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from push_predictor.errors import PushPredictorError
from push_predictor.evaluation.report.tables import metrics_tables
from push_predictor.evaluation.validation import metrics_json
from push_predictor.recordings.atomic import write_whole
from push_predictor.reporting import html
from push_predictor.residuals.evidence.standardised import RULE
from push_predictor.residuals.outcome import Tested, Trace
from push_predictor.residuals.reporting.figures.gallery import effect_figures, error_figure, key_figure
from push_predictor.residuals.reporting.phrases import (
    bare,
    covariate_phrase,
    detectable_size,
    effect_phrase,
    mechanism_phrase,
    p_text,
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
    trained = html.count(model.provenance.pushes, "training push", "training pushes")
    analysis = html.count(len(trace.analysis.pushes), "push", "pushes")
    held_out = html.count(len(held.table.pushes), "push", "pushes")
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
    return [heading, html.paragraph(evidence(trace)), *effect_figures(trace)]


def _rivals(trace: Trace) -> list[str]:
    if not trace.effects:
        return []
    text = rivals(trace) or "No other candidate explains these pushes as well."
    parts = [html.heading("Rival explanations, and pushes that would decide"), html.paragraph(text)]
    return [*parts, html.bullets(advice(trace))] if trace.equivalent else parts


def _held_out(trace: Trace) -> list[str]:
    method = (
        f"{worth(trace)} All figures are of pushes that took no part in the search. Before: the deployed model. "
        "Refit: the same model retrained on the analysis pushes, without the effect. Of an analytical model only the "
        f"covariance is estimated again. {_after(trace)}"
    )
    heading = html.heading("Before, refit, after")
    return [heading, html.paragraph(method.lstrip()), *error_figure(trace), *metric_tables(trace)]


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


def tested_table(trace: Trace) -> str:
    """All candidates, smallest p first."""
    best = sorted(trace.tested, key=lambda t: t.p_value)
    caption = (
        f"{html.count(len(best), 'pair', 'pairs')} of mechanism and covariate, each in its best basis, before any "
        "effect is subtracted. Neighbours of a true effect are often significant too, because covariates and responses "
        "correlate."
    )
    head = ("mechanism", "depends on", "family-wise p", "")
    return html.folded_table(caption, head, [_tested_row(trace, tested) for tested in best])


def metric_tables(trace: Trace) -> list[str]:
    """All metrics for each output before, after the refit and with the effects."""
    shown = trace.comparisons
    metrics = [metrics_json(comparison) for comparison in shown]
    if len({comparison.push_id.tobytes() for comparison in shown}) == 1:
        return metrics_tables(shown, metrics)
    return [table for c, m in zip(shown, metrics, strict=True) for table in metrics_tables([c], [m])]


def detectable_table(trace: Trace) -> str:
    """The smallest detectable effects."""
    entries = trace.minimum_detectable.items()
    rows = [[bare(mechanism_phrase(name)), detectable_size(entry, 3) or html.NOTHING] for name, entry in entries]
    caption = (
        "The smallest detectable effect of each mechanism: what the search finds with 80 % probability on these pushes "
        "at this level, if it is constant."
    )
    return html.folded_table(caption, ("mechanism", "constant effect"), rows)


def _tested_row(trace: Trace, tested: Tested) -> list[str]:
    names = mechanism_phrase(tested.mechanism), covariate_phrase(tested.covariate)
    mark = role_of(trace, tested) or ("p below alpha" if tested.p_value <= trace.alpha else "")
    return [*map(bare, names), p_text(tested.p_value), mark]


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
