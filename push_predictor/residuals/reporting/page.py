"""A trace as one self-contained HTML page: the answer first, then its evidence, then data and method."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from push_predictor.errors import PushPredictorError
from push_predictor.recordings.atomic import write_whole
from push_predictor.reporting import html
from push_predictor.residuals.evidence.split import RULE
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.advice import separating_words
from push_predictor.residuals.reporting.figures.gallery import (
    calibration_picture,
    channel_picture,
    effect_pictures,
    tested_picture,
)
from push_predictor.residuals.reporting.figures.map_pictures import map_pictures
from push_predictor.residuals.reporting.phrases import effect_phrase
from push_predictor.residuals.reporting.quantities import count
from push_predictor.residuals.reporting.tables import (
    detectable_table,
    effects_table,
    experiment_table,
    held_out_tables,
    shifts_table,
    tested_tables,
)
from push_predictor.residuals.reporting.wording import evidence_sentence, headline, worth_sentence

VERDICTS = {
    "none": "no change found",
    "effect": "effect named",
    "driver_only": "mechanism unknown",
    "mechanism_only": "cause undecided",
    "wrench_only": "force only",
    "measurement": "measurement error",
    "variance": "noise only",
}
UNNAMED = (
    "A mechanism is named only if it explains nearly as much as a general pattern over contact point and push angle. "
    "None does. A tested mechanism can be significant because it resembles the pattern."
)
EXPERIMENT = (
    "Make the pushes below, with the covariates set as the table shows. There the predictions of the rivals differ "
    "most. Each push is in these data, at other values of the covariates."
)


def write_trace_report(path: Path, trace: Trace) -> Path:
    """Write the page with its pictures; return its path. Raises OSError, or PushPredictorError for a failed picture."""
    path = Path(path)
    try:
        with TemporaryDirectory() as folder:
            parts = _parts(Path(folder), trace)
    except (OSError, PushPredictorError):
        raise
    except Exception as error:  # a picture must not cost the caller the verdict
        raise PushPredictorError(f"{path}: the report could not be drawn ({type(error).__name__}: {error})") from error
    write_whole(path, html.page(f"What the model `{trace.model.name}` fails to explain", parts).encode())
    return path


def _parts(out: Path, trace: Trace) -> list[str]:
    return [
        html.finding(f"{headline(trace)}.", VERDICTS[trace.verdict], evidence_sentence(trace)),
        html.paragraph(worth_sentence(trace), "lead"),
        *_effects(out, trace),
        *_rivals(trace),
        *_held_out(out, trace),
        *_residuals(out, trace),
        *_tested(out, trace),
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
    return {
        "model": f"{model.name} ({model.kind}; {model.rig.shape} on {model.rig.surface}), {trained}",
        "analysis": f"{analysis}, {len(trace.analysis)} windows",
        "held out": f"{held_out}, {len(held.table)} windows, opened once, after every choice was made",
        "split": f"by push: {RULE}",
        "held-out SHA-256": held.digest,
        "family-wise level": f"{trace.alpha:g}: the probability of any false alarm if nothing changed",
        "motion model": "extended" if trace.extended is not None else "unchanged",
    }


def _effects(out: Path, trace: Trace) -> list[str]:
    if not trace.effects:
        return []
    parts = [html.heading("The effect" if len(trace.effects) == 1 else "The effects"), effects_table(trace)]
    if trace.terms:
        parts.append(shifts_table(trace))
    return [*parts, *map(html.figure, [*effect_pictures(out, trace), *channel_picture(out, trace)])]


def _rivals(trace: Trace) -> list[str]:
    if not trace.effects:
        return []
    parts = [html.heading("Rival explanations, and pushes that would decide"), html.paragraph(_rivals_sentence(trace))]
    if trace.verdict == "driver_only":
        parts.append(html.paragraph(UNNAMED))
    if trace.equivalent:
        parts.append(html.bullets(separating_words([trace.effects[0].covariate, *trace.equivalent])))
    if trace.experiment:
        parts += [html.paragraph(EXPERIMENT), experiment_table(trace)]
    return parts


def _rivals_sentence(trace: Trace) -> str:
    if not trace.equivalent and not trace.mechanisms:
        return "No other candidate explains these pushes as well."
    if trace.undecided:
        return "These data do not decide between the explanations above."
    return "The explanation above fits best, but these data do not exclude the others."


def _held_out(out: Path, trace: Trace) -> list[str]:
    intro = (
        f"{_after(trace)} All figures are of pushes that took no part in the search. Before: the deployed model. "
        "Refit: the same model retrained on the analysis pushes, without the effect. Of an analytical model only the "
        "covariance is estimated again."
    )
    parts = [html.heading("Before, refit, after"), html.paragraph(intro), *held_out_tables(trace)]
    return [*parts, html.heading("Calibration"), *map(html.figure, calibration_picture(out, trace))]


def _after(trace: Trace) -> str:
    if trace.terms:
        return "After: the refit with the effects found."
    if trace.verdict == "measurement":
        return "After: the deployed model, unchanged, on windows cut again from corrected recordings, if there are any."
    return "Nothing was added, so there is no model after the refit."


def _residuals(out: Path, trace: Trace) -> list[str]:
    return [html.heading("Residuals before and after"), *map(html.figure, map_pictures(out, trace))]


def _tested(out: Path, trace: Trace) -> list[str]:
    parts = [html.heading("What else was tested")]
    if not trace.tested:
        return [*parts, html.paragraph("Nothing could be tested: see the notes.", "warning")]
    return [*parts, *map(html.figure, tested_picture(out, trace)), *tested_tables(trace)]


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
        return "A second search, with the effects found subtracted, found nothing more."
    strongest = effect_phrase(*trace.remaining)
    return f"Something remains after the effects found are subtracted. The strongest candidate is {strongest}."
