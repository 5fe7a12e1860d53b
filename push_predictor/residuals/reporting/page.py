"""A trace as one HTML page that stands alone: whoever reads only this can argue with it."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from push_predictor.recordings.atomic import write_whole
from push_predictor.reporting import html
from push_predictor.residuals.evidence.drivers import CONSTANT
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
from push_predictor.residuals.reporting.tables import (
    detectable_table,
    effects_table,
    experiment_table,
    held_out_tables,
    shifts_table,
    tested_tables,
)
from push_predictor.residuals.reporting.wording import (
    count,
    driver_words,
    mechanism_words,
    verdict_sentence,
    worth_sentence,
)

VERDICTS = {
    "none": "nothing found",
    "effect": "effect named",
    "driver_only": "driver known, mechanism unknown",
    "mechanism_only": "mechanism known, driver undecided",
    "wrench_only": "wrench only",
    "measurement": "measurement error",
    "variance": "variance only",
}

UNNAMED = (
    "A mechanism is named only if it leaves little along the driver that the general pattern over contact and angle "
    "still takes. Some mechanisms above may be significant: they resemble the pattern, but none passed that test."
)


def write_trace_report(path: Path, trace: Trace) -> Path:
    """Write the page, pictures in it; returns its path. Raises OSError, or PushPredictorError without matplotlib."""
    path = Path(path)
    with TemporaryDirectory() as folder:
        parts = _parts(Path(folder), trace)
    write_whole(path, html.page(f"What {trace.model.name} leaves over", parts).encode())
    return path


def _parts(out: Path, trace: Trace) -> list[str]:
    return [
        html.finding("Verdict", _verdict(trace), verdict_sentence(trace)),
        html.paragraph(worth_sentence(trace), "lead"),
        html.definitions(_facts(trace)),
        *_residuals(out, trace),
        *_effects(out, trace),
        *_tested(out, trace),
        *_rivals(trace),
        *_held_out(out, trace),
        *_left(trace),
        *([html.heading("Notes"), html.bullets(trace.notes)] if trace.notes else []),
    ]


def _verdict(trace: Trace) -> str:
    if trace.verdict == "driver_only" and trace.effects[0].covariate == CONSTANT:
        return "no driver, mechanism unknown"
    return VERDICTS[trace.verdict]


def _facts(trace: Trace) -> dict[str, str]:
    model, held = trace.model, trace.held_out
    return {
        "model": f"{model.name} ({model.kind}; {model.rig.shape} on {model.rig.surface}), "
        f"{count(model.provenance.pushes, 'training push', 'training pushes')}",
        "analysis": f"{count(len(trace.analysis.pushes), 'push', 'pushes')}, {len(trace.analysis)} windows",
        "held out": f"{count(len(held.table.pushes), 'push', 'pushes')}, {len(held.table)} windows, opened once, "
        f"after everything was chosen",
        "split": f"by push: {RULE}",
        "held-out sha256": held.digest,
        "family-wise level": f"{trace.alpha:g}: the probability of any false alarm where there is nothing",
        "motion model": "extended" if trace.extended is not None else "left as it is",
    }


def _residuals(out: Path, trace: Trace) -> list[str]:
    return [html.heading("Residuals before and after"), *map(html.figure, map_pictures(out, trace))]


def _effects(out: Path, trace: Trace) -> list[str]:
    if not trace.effects:
        return []
    parts = [html.heading("The effect" if len(trace.effects) == 1 else "The effects"), effects_table(trace)]
    if trace.terms:
        parts.append(shifts_table(trace))
    for index in range(len(trace.terms)):
        parts += map(html.figure, effect_pictures(out, trace, index))
    return [*parts, *map(html.figure, channel_picture(out, trace))]


def _tested(out: Path, trace: Trace) -> list[str]:
    parts = [html.heading("What else was tested")]
    if not trace.tested:
        return [*parts, html.paragraph("Nothing could be tested: see the notes.", "warning")]
    return [*parts, *map(html.figure, tested_picture(out, trace)), *tested_tables(trace)]


def _rivals(trace: Trace) -> list[str]:
    if not trace.effects:
        return []
    parts = [html.heading("Rivals, and what would separate them"), html.paragraph(_rivals_sentence(trace))]
    if trace.verdict == "driver_only":
        parts.append(html.paragraph(UNNAMED))
    if trace.equivalent:
        parts.append(html.bullets(separating_words([trace.effects[0].covariate, *trace.equivalent])))
    if trace.experiment:
        words = (
            "Each push below has been made here already, at other values of the drivers. Make it again with the "
            "drivers set as the table says, one rival's low while the other's is high: there the rivals predict most "
            "differently, and one of them will be wrong."
        )
        parts += [html.paragraph(words), experiment_table(trace)]
    return parts


def _rivals_sentence(trace: Trace) -> str:
    first = trace.effects[0]
    named = f"{mechanism_words(first.mechanism)}, {driver_words(first.covariate)}"
    if not trace.equivalent and not trace.mechanisms:
        return f"No other candidate explains these pushes as well as {named}."
    others = []
    if trace.equivalent:
        others.append(f"other drivers: {', '.join(trace.equivalent)}")
    if trace.mechanisms:
        others.append(f"other mechanisms: {', '.join(map(mechanism_words, trace.mechanisms))}")
    sure = "which it is stays undecided" if trace.undecided else "the first is the best, but not surely so"
    return f"These data cannot tell {named} from its rivals ({'; '.join(others)}): {sure}."


def _held_out(out: Path, trace: Trace) -> list[str]:
    intro = (
        "On pushes that took no part in the search. Before: the deployed model; refit: the same model made anew from "
        f"the analysis pushes in its own inputs (of an analytical model, its covariance alone). {_after(trace)}"
    )
    parts = [html.heading("Before, refit, after"), html.paragraph(intro), *held_out_tables(trace)]
    return [*parts, html.heading("Calibration"), *map(html.figure, calibration_picture(out, trace))]


def _after(trace: Trace) -> str:
    if trace.terms:
        return "After: the refit with what was found."
    if trace.verdict == "measurement":
        return "After: the deployed model, unchanged, on windows cut again from recordings put right, if there are any."
    return "Nothing was added, so after is the refit."


def _left(trace: Trace) -> list[str]:
    left = "nothing that it could see" if trace.remaining is None else f"something, strongest {trace.remaining}"
    remaining = f"The search was run again with what was found taken out. It left {left}."
    if trace.verdict == "measurement":
        remaining = "The motion was not searched: put the measurement right first, record or cut again, and trace anew."
    parts = [html.heading("What is left, and what could have been missed"), html.paragraph(remaining)]
    if not trace.minimum_detectable:
        return [*parts, html.paragraph("The smallest effect that would have been found was not determined.")]
    return [*parts, detectable_table(trace)]
