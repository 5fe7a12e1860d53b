"""The pictures of a validation report with their captions, in the order in which they are shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from push_predictor.evaluation.report.figures.calibration import paint_calibration
from push_predictor.evaluation.report.figures.ellipses import paint_examples
from push_predictor.evaluation.report.figures.nearby import ENOUGH, examples
from push_predictor.evaluation.report.figures.push_maps import Panel, paint_maps
from push_predictor.evaluation.report.figures.residuals import course_of, paint_residuals
from push_predictor.evaluation.report.figures.tracks import paint_tracks
from push_predictor.evaluation.report.map_conditions import fixed_covariates, fixed_covariates_text
from push_predictor.evaluation.report.maps import (
    FEWEST,
    Condition,
    PushMap,
    coarse_cells,
    commonest_condition,
    fine_cells,
    fold_order,
    predicted_at_windows,
    push_map,
    recorded_map,
)
from push_predictor.evaluation.validation import Comparison
from push_predictor.models.push_model import ExtendedPredictor, PushModel
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.reporting.canvas import Picture, draw

WIDTH = 10.0  # inches
EXAMPLES = 6


@dataclass(frozen=True, eq=False)
class Validation:
    """What was validated: models and comparisons in the same order, the first is the main one; windows if known."""

    table: PushTable
    windows: Sequence[PushWindow] | None
    models: Sequence[PushModel]
    comparisons: Sequence[Comparison]


def map_pictures(out: Path, shown: Validation) -> list[Picture]:
    """Mean and sd over contact and angle at the commonest speed, predicted and recorded."""
    condition = commonest_condition(shown.table)
    panels = _map_panels(shown, condition)
    recorded = panels[-1].map
    outline = shown.models[0].rig.outline
    size = (WIDTH, 6.6)
    mean, sd, at = out / "map_mean.png", out / "map_sd.png", _held_caption(shown, condition)
    draw(mean, size, lambda figure: paint_maps(figure, outline, panels, "mean"))
    draw(sd, size, lambda figure: paint_maps(figure, outline, panels, "sd"))
    return [
        Picture(mean, _map_alt("mean", panels), _mean_caption(condition, recorded) + at),
        Picture(sd, _map_alt("standard deviation", panels), _sd_caption(condition, shown.models[0].name) + at),
    ]


def example_pictures(out: Path, shown: Validation) -> list[Picture]:
    """Ellipses over outcomes, in the push frame and, where windows are known, along whole pushes."""
    rig, comparison = shown.models[0].rig, shown.comparisons[0]
    chosen = examples(rig.outline, shown.table, comparison, EXAMPLES)
    path = out / "examples.png"
    height = 2.6 * -(-len(chosen) // 2) + 0.2
    draw(path, (WIDTH, height), lambda figure: paint_examples(figure, rig, shown.table, comparison, chosen))
    pictures = [Picture(path, _example_alt(len(chosen)), _example_caption(comparison.model))]
    if windows := shown.windows:
        tracks = out / "tracks.png"
        draw(tracks, (WIDTH, 6.6), lambda figure: paint_tracks(figure, windows, comparison))
        pictures.append(Picture(tracks, "Tracks of the slider's centre with predicted ellipses.", TRACK_CAPTION))
    return pictures


def calibration_pictures(out: Path, shown: Validation) -> list[Picture]:
    """Coverage curves and PIT histograms of all models."""
    path, comparisons = out / "calibration.png", shown.comparisons
    draw(path, (WIDTH, 2.45 * len(comparisons) + 0.3), lambda figure: paint_calibration(figure, comparisons))
    alt = f"Coverage curves and PIT histograms of {', '.join(c.model for c in comparisons)}."
    return [Picture(path, alt, CALIBRATION_CAPTION)]


def residual_pictures(out: Path, shown: Validation) -> list[Picture]:
    """Predicted against observed, and residuals in the order of time, of the main model."""
    path, comparison = out / "residuals.png", shown.comparisons[0]
    course = course_of(comparison, shown.windows)
    draw(path, (WIDTH, 6.0), lambda figure: paint_residuals(figure, comparison, course))
    alt = "Predicted against observed displacement per output, and standardised residuals in the order of time."
    return [Picture(path, alt, f"{comparison.model}. {RESIDUAL_CAPTION}")]


def _map_panels(shown: Validation, condition: Condition) -> list[Panel]:
    """Every model's map, the main model at the recorded windows, and the recorded map last."""
    rows, outline = condition.rows, shown.models[0].rig.outline
    alike = shown.table.take(rows)
    fine, coarse = fine_cells(outline, alike), coarse_cells(outline, alike)
    main = shown.comparisons[0]
    held = [fixed_covariates(model, alike) for model in shown.models]
    velocity, duration = condition.velocity, condition.duration
    panels = [Panel(m.name, push_map(m, velocity, duration, fine, h)) for m, h in zip(shown.models, held, strict=True)]
    same = predicted_at_windows(outline, alike, main.mean[rows], main.variance[rows], coarse)
    return [
        *panels,
        Panel(f"{main.model}, at the\nrecorded windows", same),
        Panel("recorded\n(digits: pushes)", recorded_map(outline, alike, main.mean[rows], coarse), counted=True),
    ]


def _mean_caption(condition: Condition, recorded: PushMap) -> str:
    windows = recorded.windows if recorded.windows is not None else np.zeros((1, 1), np.int64)
    filled = windows >= FEWEST
    typical = f"; the median shown cell holds {np.median(windows[filled]):.0f}" if filled.any() else ""
    return (
        f"Mean outcome over contact and push angle, {_of_condition(condition)} All panels of a row share their "
        f"colours. The maps of the models are evaluated at cell centres; the two panels on the right average the same "
        f"windows in the same cells, so they may be compared cell by cell. Grey and hatched: fewer than {FEWEST} "
        f"windows in the cell ({filled.sum()} of {filled.size} cells are shown{typical}), or outside the domain of "
        f"the training pushes. Digits: how many pushes the windows of a cell come from."
    )


def _sd_caption(condition: Condition, main: str) -> str:
    return (
        f"Standard deviation of the outcome, {_of_condition(condition)} Predicted: of an observed outcome, process "
        f"noise and the model's own uncertainty together. Recorded: root mean square of the observed outcome less "
        f"the mean that {main} predicts for that very window, which is what its sd speaks of; so the variation of "
        f"the inputs within a cell does not count as noise, and an error of the mean does. Windows of one push err "
        f"alike: a recorded cell is worth about as many measurements as the pushes written into it, and from k of "
        f"them it is uncertain by about 1/√(2k), 50 % for two and 25 % for eight."
    )


def _held_caption(shown: Validation, condition: Condition) -> str:
    """At which covariates the maps of extended models are drawn; empty if none is extended."""
    alike, outline = shown.table.take(condition.rows), shown.models[0].rig.outline
    told = [fixed_covariates_text(model, fixed_covariates(model, alike)) for model in shown.models]
    extended = [model.name for model in shown.models if isinstance(model.predictor, ExtendedPredictor)]
    if extended and (sides := fold_order(outline)) > 1:
        told.append(f"Effects may differ between sides: of the outline's {sides} alike parts, the first is drawn.")
    return "".join(f" {text}" for text in told if text)


def _of_condition(condition: Condition) -> str:
    return (
        f"windows near {condition.velocity * 1e3:.3g} mm/s only (± 10 %, the commonest speed: "
        f"{condition.rows.sum()} of {condition.rows.size} windows), {condition.duration:.3g} s long."
    )


def _map_alt(quantity: str, panels: Sequence[Panel]) -> str:
    names = "; ".join(panel.title.replace("\n", " ") for panel in panels)
    return f"Colour maps of the {quantity} of dx, dy and dtheta over contact and push angle: {names}."


def _example_alt(count: int) -> str:
    return f"{count} example pushes: slider outlines before and after, predicted 95 % ellipses and observed outcomes."


def _example_caption(model: str) -> str:
    return (
        f"{model}: {EXAMPLES} windows at most, spread over contact and angle, each of another push, chosen by their "
        f"inputs alone. Left: the slider at the start (grey), observed (orange) and predicted (blue, dashed), pushed "
        f"to the right. Middle: predicted 95 % ellipse and the observed outcome in the push frame. Right: the 95 % "
        f"interval of the turn. Grey dots: outcomes of windows with nearby inputs (a tenth of the folded outline, "
        f"10°, 10 % of speed), moved by the difference of the predicted means, so that they scatter only by what "
        f"the mean leaves unexplained; windows with at least {ENOUGH} such neighbours are preferred."
    )


TRACK_CAPTION = (
    "Whole pushes from above, the centre of the slider, its track laid to the right. Each ellipse is "
    "predicted from the observed pose at its window's start and should hold the next observed point in 95 % of cases. "
    "Shown are long pushes: the one that turns the slider most clockwise, a middling one, and the most "
    "counter-clockwise."
)
CALIBRATION_CAPTION = (
    "Left: share of outcomes inside the central predicted interval against the share it should hold; shaded: 95 % "
    "by resampling whole pushes. Above the diagonal the predicted scatter is too wide, below too narrow. Right: "
    "probability integral transform; grey band: where 95 % of the bars of a calibrated prediction would lie if windows "
    "were independent. Windows of one push are not, so bars leave the band more often than that. A hump means too "
    "wide, a trough too narrow, a slope a shifted mean. All by the moment-matched Gaussian."
)
RESIDUAL_CAPTION = (
    "Above: predicted against observed, with the predicted 95 % interval of every window (grey) about the diagonal. "
    "Below: residuals in units of the predicted sd in the order of time, windows in grey (those beyond the frame at "
    "its edge), means of pushes in colour; the band holds 95 % if all is well. Trend: change of the residual from the "
    "first to the last window, with its 95 % interval by resampling pushes; an interval without zero is a drift."
)
