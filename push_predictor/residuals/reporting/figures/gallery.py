"""The pictures of a trace's report, with their captions."""

from __future__ import annotations

from pathlib import Path

from push_predictor.evaluation.report.figures.calibration import paint_calibration
from push_predictor.models.effects.effect import Effect
from push_predictor.reporting.canvas import Picture, draw
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.channels import channel_of, paint_channel
from push_predictor.residuals.reporting.figures.driver_basis import hidden_pushes, paint_basis
from push_predictor.residuals.reporting.figures.partial import Rows, Strength, analysis_rows, held_out_rows, strength_of
from push_predictor.residuals.reporting.figures.shifts import course_of, paint_course, paint_shifts
from push_predictor.residuals.reporting.figures.tested import FLOOR, best_of, grid_of, paint_tested
from push_predictor.residuals.reporting.phrases import capitalised, covariate_phrase, effect_phrase, listed, moved_noun
from push_predictor.residuals.reporting.quantities import count
from push_predictor.residuals.reporting.summary import comparisons_of

WIDTH = 10.0  # inches
BARS = "Bars: 95 % intervals from a bootstrap of pushes."


def effect_pictures(out: Path, trace: Trace) -> list[Picture]:
    """Each effect against its covariate (against the push angle if it is constant), and its shifts."""
    if not trace.terms:
        return []
    analysis, held_out = analysis_rows(trace), _held_out_rows(trace)
    every = range(len(trace.terms))
    return [picture for k in every for picture in _of_effect(out, trace, k, analysis, held_out)]


def _of_effect(out: Path, trace: Trace, index: int, analysis: Rows, held_out: Rows | None) -> list[Picture]:
    """One effect, and its shifts as fitted and as found."""
    effect = trace.terms[index]
    strength = strength_of(effect, trace.analysis)
    first = (
        _basis_picture(out / f"basis_{index}.png", trace, strength, analysis, held_out)
        if effect.basis.drivers
        else _course_picture(out / f"course_{index}.png", trace, effect, analysis)
    )
    path = out / f"shifts_{index}.png"
    draw(path, (WIDTH, 3.4), lambda figure: paint_shifts(figure, trace, effect, analysis, held_out))
    caption = (
        "Does the effect appear where the fit predicts it? Each point is the mean shift observed in windows of similar "
        "fitted shift, beyond the model and the other effects. Points on the line confirm the fit. Points on a "
        f"horizontal line would mean no effect. {BARS} {_data_words(trace)}"
    )
    return [first, Picture(path, "Observed against fitted shift of dx, dy and dtheta.", caption)]


def channel_picture(out: Path, trace: Trace) -> list[Picture]:
    """The data behind a finding that shifts no mean: the force, the gap at the contact, the noise."""
    channel = channel_of(trace) if trace.effects and not trace.terms else None
    if channel is None:
        return []
    path = out / "channel.png"
    draw(path, (WIDTH, 3.8), lambda figure: paint_channel(figure, trace.analysis, channel))
    pushes = count(len(trace.analysis.pushes), "analysis push", "analysis pushes")
    title = capitalised(f"{channel.title} against {channel.label[:1].lower()}{channel.label[1:]}")
    caption = (
        f"{title}, as recorded in {pushes}. Each point covers the same number of windows. {BARS} Unlike in the test, "
        "the inputs of the push are not regressed out here."
    )
    return [Picture(path, f"{title}.", caption)]


def tested_picture(out: Path, trace: Trace) -> list[Picture]:
    """The family-wise p of every mechanism with every covariate."""
    if not trace.tested:
        return []
    rows, columns, _ = grid_of(trace.tested)
    path = out / "tested.png"
    draw(path, (WIDTH, 2.2 + 0.27 * len(rows)), lambda figure: paint_tested(figure, trace))
    caption = (
        f"Family-wise p of all {len(best_of(trace.tested))} pairs of {count(len(rows), 'mechanism', 'mechanisms')} and "
        f"{count(len(columns), 'covariate', 'covariates')}, each in its best basis, before any effect is subtracted. "
        f"Ring: found. Dot: rival of the first effect. Grey: not tried. Values below {FLOOR:g} share a colour; "
        f"the orange line marks alpha = {trace.alpha:g}. Neighbours of a true effect are often significant too, "
        "because covariates and responses correlate."
    )
    return [Picture(path, "Family-wise p of every mechanism with every covariate.", caption)]


def calibration_picture(out: Path, trace: Trace) -> list[Picture]:
    """Coverage and PIT before, after the refit and with the effects."""
    shown = comparisons_of(trace)
    if not len(shown[0].observed):
        return []
    path = out / "calibration.png"
    draw(path, (WIDTH, 2.5 * len(shown)), lambda figure: paint_calibration(figure, shown))
    caption = (
        f"Calibration on {count(len(trace.held_out.table.pushes), 'held-out push', 'held-out pushes')}. Left: share of "
        "outcomes inside the central predicted interval, against its nominal share; band: 95 %, bootstrap of pushes. "
        "Right: probability integral transform (PIT), uniform for a calibrated model. A hump: the predicted "
        "uncertainty is too large. A trough: it is too small. A slope: the mean is biased. Grey: 95 % range of the "
        "bars for independent windows; windows of one push are not independent."
    )
    return [Picture(path, "Coverage curves and histograms of the probability integral transform.", caption)]


def _basis_picture(path: Path, trace: Trace, strength: Strength, analysis: Rows, held_out: Rows | None) -> Picture:
    effect = strength.effect
    wide = len(effect.basis.drivers) > 1
    height = 3.4 * len(strength.names) if wide else 4.2
    draw(path, (WIDTH, height), lambda figure: paint_basis(figure, trace, strength, analysis, held_out))
    name = capitalised(moved_noun(effect.mechanism))
    covariates = listed([covariate_phrase(driver) for driver in effect.basis.drivers])
    what = f"{name} against {covariates} ({effect.basis.name})"
    hidden = hidden_pushes(strength, trace, analysis)
    data = (
        "Left: the fitted map. Right: each cell estimated separately."
        if wide
        else "Line: fitted, with its 95 % band. Points: estimated separately in each bin, from the residuals of the "
        f"model and the other effects. {BARS} Orange: the pushes of the fit. Open squares: held-out pushes. Grey dots: "
        f"single pushes. Not shown, by panel: {hidden} (outside the picture, or with too small a response)."
    )
    pattern = (
        ""
        if strength.share > 0.999
        else " The mechanism is unknown, so the strongest pattern over contact point and push angle is shown: "
        f"{100.0 * strength.share:.0f} % of the fitted coefficients' sum of squares."
    )
    caption = f"{what}. {data} {_data_words(trace)}{pattern}"
    return Picture(path, f"Fitted effect against {covariates}, with the data.", caption)


def _course_picture(path: Path, trace: Trace, effect: Effect, analysis: Rows) -> Picture:
    course = course_of(effect, trace.model.rig.outline, analysis)
    draw(path, (WIDTH, 3.4), lambda figure: paint_course(figure, trace, effect, analysis, course))
    axis = f"{course.label[:1].lower()}{course.label[1:]}"
    groups = " Colours: thirds of the edge or sector, counter-clockwise." if len(course.groups) > 1 else ""
    caption = (
        f"Shift by {effect_phrase(effect.mechanism, effect.covariate)}, against {axis}, at the most common speed and "
        f"duration.{groups} Lines: fitted, with 95 % bands. Points: observed. {BARS} {_data_words(trace)}"
    )
    return Picture(path, f"Shift of dx, dy and dtheta against {axis}.", caption)


def _held_out_rows(trace: Trace) -> Rows | None:
    held = trace.held_out
    return held_out_rows(trace) if len(held.table) and len(held.after.observed) == len(held.table) else None


def _data_words(trace: Trace) -> str:
    model = "extended" if trace.extended is not None else "deployed"
    pushes = count(len(trace.analysis.pushes), "analysis push", "analysis pushes")
    return f"Data: {pushes}, residuals of the {model} model."
