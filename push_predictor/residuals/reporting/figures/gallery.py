"""The pictures of a trace's report with their captions."""

from __future__ import annotations

from pathlib import Path

from push_predictor.evaluation.report.figures.calibration import paint_calibration
from push_predictor.models.effects.effect import Effect
from push_predictor.reporting.canvas import Picture, draw
from push_predictor.residuals.outcome import Trace
from push_predictor.residuals.reporting.figures.channels import channel_of, paint_channel
from push_predictor.residuals.reporting.figures.driver_basis import beyond, paint_basis
from push_predictor.residuals.reporting.figures.partial import Rows, Strength, analysis_rows, held_out_rows, strength_of
from push_predictor.residuals.reporting.figures.shifts import course_of, paint_course, paint_shifts
from push_predictor.residuals.reporting.figures.tested import FLOOR, best_of, grid_of, paint_tested
from push_predictor.residuals.reporting.summary import comparisons_of
from push_predictor.residuals.reporting.wording import count, driver_words, mechanism_words

WIDTH = 10.0  # inches


def effect_pictures(out: Path, trace: Trace, index: int) -> list[Picture]:
    """An effect: its basis over its driver, or its response where none drives it; found against fitted shifts."""
    effect = trace.terms[index]
    analysis, held_out = analysis_rows(trace), _held_out_rows(trace)
    strength = strength_of(effect, trace.analysis)
    first = (
        _basis_picture(out / f"form_{index}.png", trace, strength, analysis, held_out)
        if effect.basis.drivers
        else _course_picture(out / f"course_{index}.png", trace, effect, analysis)
    )
    path = out / f"shifts_{index}.png"
    draw(path, (WIDTH, 3.4), lambda figure: paint_shifts(figure, trace, effect, analysis, held_out))
    caption = (
        f"Is the shift there that the fit says? Windows with like fitted shift are put together (as many in each "
        f"point); upright: the mean of what they really did beyond the model and the other terms, with 95 % intervals "
        f"by drawing whole pushes anew. On the line, fitted and found agree; level points would mean that the effect "
        f"is not there. {_data_words(trace)}"
    )
    return [first, Picture(path, "Found against fitted shift of dx, dy and dtheta.", caption)]


def channel_picture(out: Path, trace: Trace) -> list[Picture]:
    """What a finding rests on that moves no mean: the force, the gap at the contact, the scatter."""
    channel = channel_of(trace) if trace.effects and not trace.terms else None
    if channel is None:
        return []
    path = out / "channel.png"
    draw(path, (WIDTH, 3.8), lambda figure: paint_channel(figure, trace.analysis, channel))
    pushes = count(len(trace.analysis.pushes), "analysis push", "analysis pushes")
    caption = (
        f"{channel.title} over {channel.label}, as recorded in {pushes}. Points: as many windows in each, with 95 % "
        f"intervals by drawing whole pushes anew. The other inputs of the push are not taken out here, as they are in "
        f"the test."
    )
    return [Picture(path, f"{channel.title} over {channel.label}.", caption)]


def tested_picture(out: Path, trace: Trace) -> list[Picture]:
    """The map of all that was tried."""
    if not trace.tested:
        return []
    rows, columns, _ = grid_of(trace.tested)
    path = out / "tested.png"
    draw(path, (WIDTH, 2.2 + 0.27 * len(rows)), lambda figure: paint_tested(figure, trace))
    caption = (
        f"All that was tried: {count(len(rows), 'mechanism', 'mechanisms')} and "
        f"{count(len(columns), 'driver', 'drivers')}, {len(best_of(trace.tested))} pairs, with the smallest "
        f"family-wise p of each pair's bases (below {FLOOR:g} all look alike; the orange line in the bar is alpha = "
        f"{trace.alpha:g}). Ring: what was found; dot: rival of the first; hatched or grey: not tried. That a "
        f"neighbour of the right cell is significant too is to be expected: drivers go together, and so do "
        f"responses. The first look at all candidates is shown, before anything was taken out."
    )
    return [Picture(path, "Family-wise p of every mechanism and driver.", caption)]


def calibration_picture(out: Path, trace: Trace) -> list[Picture]:
    """Coverage and PIT before, after the refit and with the effect."""
    shown = comparisons_of(trace)
    if not len(shown[0].observed):
        return []
    path = out / "calibration.png"
    draw(path, (WIDTH, 2.5 * len(shown)), lambda figure: paint_calibration(figure, shown))
    caption = (
        f"Calibration on {count(len(trace.held_out.table.pushes), 'held-out push', 'held-out pushes')}. Left: share of "
        f"outcomes inside the central predicted interval against its nominal share, band: 95 % by drawing whole "
        f"pushes. Right: where outcomes lie in their predicted distributions; level is right, a hump is too wide a "
        f"prediction, a hollow too narrow, a slope biased. Grey: 95 % of bars if windows were independent, which "
        f"they are not within a push."
    )
    return [Picture(path, "Coverage curves and PIT histograms.", caption)]


def _basis_picture(path: Path, trace: Trace, strength: Strength, analysis: Rows, held_out: Rows | None) -> Picture:
    effect = strength.effect
    wide = len(effect.basis.drivers) > 1
    height = 3.4 * len(strength.names) if wide else 4.2
    draw(path, (WIDTH, height), lambda figure: paint_basis(figure, trace, strength, analysis, held_out))
    what = f"{mechanism_words(effect.mechanism)}, {driver_words(' and '.join(effect.basis.drivers), effect.basis.name)}"
    data = (
        "Right: estimated in each cell by itself."
        if wide
        else "Points: the same parameter estimated in each bin of the driver by itself, by least squares on what the "
        "model and the other terms leave, with 95 % intervals by drawing the bin's pushes anew; orange: the pushes the "
        "curve was fitted to; open squares: held-out pushes that the fit has not seen. Grey dots: single pushes; "
        f"{beyond(strength, trace, analysis)} lie beyond the picture or tell nothing (where the response is small)."
    )
    pattern = "" if strength.share > 0.999 else (
        f" The mechanism is unknown: shown is the strongest pattern over contact and angle, which holds "
        f"{100.0 * strength.share:.0f} % of the fitted coefficients' sum of squares."
    )  # fmt: skip
    fitted = "Left: the fitted map." if wide else "Line: the fitted basis with its 95 % band."
    caption = f"{what}. {fitted} {data} {_data_words(trace)}{pattern}"
    return Picture(path, f"Fitted basis of {what}, and the data.", caption)


def _course_picture(path: Path, trace: Trace, effect: Effect, analysis: Rows) -> Picture:
    course = course_of(effect, trace.model.rig.outline, analysis)
    draw(path, (WIDTH, 3.4), lambda figure: paint_course(figure, trace, effect, analysis, course))
    groups = " by thirds of the edge or sector of the outline (counter-clockwise)," if len(course.groups) > 1 else ""
    caption = (
        f"{mechanism_words(effect.mechanism)}, {driver_words(effect.covariate)}: what it does to the outcome over "
        f"{course.label},{groups} at the commonest speed and duration. Lines with 95 % bands: fitted, averaged over "
        f"the windows of each point; points: found, with 95 % intervals by drawing whole pushes anew. "
        f"{_data_words(trace)}"
    )
    return Picture(path, f"Shift by {mechanism_words(effect.mechanism)} over {course.label}.", caption)


def _held_out_rows(trace: Trace) -> Rows | None:
    held = trace.held_out
    return held_out_rows(trace) if len(held.table) and len(held.after.observed) == len(held.table) else None


def _data_words(trace: Trace) -> str:
    whose = "the extended model" if trace.extended is not None else "the deployed model"
    pushes = count(len(trace.analysis.pushes), "analysis push", "analysis pushes")
    return f"Data: {pushes}, residuals of {whose}."
