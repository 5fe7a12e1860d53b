# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A trace as one self-contained HTML page: the answer first, then its evidence, then data and method."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from push_predictor.errors import PushPredictorError
from push_predictor.recordings.atomic import write_whole
from push_predictor.reporting import html
from push_predictor.residuals.evidence.split import RULE
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.gallery import (
    calibration_figures,
    effect_figures,
    error_figure,
    key_figure,
)
from push_predictor.residuals.reporting.figures.maps import map_figures
from push_predictor.residuals.reporting.phrases import count, effect_phrase
from push_predictor.residuals.reporting.rivals import advice, rivals
from push_predictor.residuals.reporting.sentences import answer, evidence, shift_sentence, worth
from push_predictor.residuals.reporting.tables import (
    detectable_table,
    effects_table,
    held_out_table,
    metric_tables,
    shifts_table,
    tested_tables,
)

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
        *_residuals(trace),
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
    return [*parts, shifts_table(trace), *effect_figures(trace)] if trace.terms else parts


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
    every = [html.paragraph(method), *metric_tables(trace), *calibration_figures(trace)]
    parts = [html.heading("Before, refit, after"), html.paragraph(worth(trace)), held_out_table(trace)]
    return [*parts, *error_figure(trace), html.details("All metrics, and the calibration", html.joined(every))]


def _after(trace: Trace) -> str:
    if trace.terms:
        return "After: the refit with the effects found."
    if trace.verdict == "measurement":
        return "After: the deployed model, unchanged, on windows cut again from corrected recordings, if there are any."
    return "Nothing was added, so there is no model after the refit."


def _residuals(trace: Trace) -> list[str]:
    figures = map_figures(trace)
    return [html.heading("Residuals before and after"), *figures] if figures else []


def _tested(trace: Trace) -> list[str]:
    parts = [html.heading("What else was tested")]
    if not trace.tested:
        return [*parts, html.paragraph("Nothing could be tested: see the notes.", "warning")]
    closest = [] if trace.effects else [html.paragraph(evidence(trace))]
    return [*parts, *closest, *tested_tables(trace)]


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
