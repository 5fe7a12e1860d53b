# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The figures of a validation report with their captions, in the order of the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from push_predictor.evaluation.report.figures.calibration import paint_pit
from push_predictor.evaluation.report.figures.ellipses import ENOUGH, examples, paint_examples
from push_predictor.evaluation.report.figures.residuals import paint_residuals, time_axis
from push_predictor.evaluation.report.maps import (
    FEWEST,
    Condition,
    Panel,
    PushMap,
    coarse_cells,
    commonest_condition,
    fine_cells,
    fixed_covariates,
    fixed_covariates_text,
    fold_order,
    paint_maps,
    predicted_at_windows,
    push_map,
    recorded_map,
)
from push_predictor.evaluation.validation import Comparison
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor.reporting.canvas import Picture, draw

WIDTH = 10.0  # inches
EXAMPLES = 6


@dataclass(frozen=True, eq=False)
class Validation:
    """What was validated: models and comparisons in the same order, the main model first; windows if known."""

    table: PushTable
    windows: Sequence[PushWindow] | None
    models: Sequence[PushModel]
    comparisons: Sequence[Comparison]


def map_pictures(out: Path, shown: Validation) -> list[Picture]:
    """Maps of mean and sd by contact and angle at the most common speed, predicted and recorded."""
    condition = commonest_condition(shown.table)
    panels = _map_panels(shown, condition)
    recorded = panels[-1].map
    outline = shown.models[0].rig.outline
    size = (WIDTH, 6.6)
    mean, sd, at = out / "map_mean.png", out / "map_sd.png", _fixed_caption(shown, condition)
    draw(mean, size, lambda figure: paint_maps(figure, outline, panels, "mean"))
    draw(sd, size, lambda figure: paint_maps(figure, outline, panels, "sd"))
    return [
        Picture(mean, _map_alt("mean", panels), _mean_caption(condition, recorded) + at),
        Picture(sd, _map_alt("standard deviation", panels), _sd_caption(condition, shown.models[0].name) + at),
    ]


def example_pictures(out: Path, shown: Validation) -> list[Picture]:
    """Ellipses with outcomes in the push frame."""
    rig, comparison = shown.models[0].rig, shown.comparisons[0]
    chosen = examples(rig.outline, shown.table, comparison, EXAMPLES)
    path = out / "examples.png"
    height = 2.6 * -(-len(chosen) // 2) + 0.2
    draw(path, (WIDTH, height), lambda figure: paint_examples(figure, rig, shown.table, comparison, chosen))
    return [Picture(path, _example_alt(len(chosen)), _example_caption(comparison.model))]


def calibration_pictures(out: Path, shown: Validation) -> list[Picture]:
    """PIT histograms of all models."""
    path, comparisons = out / "calibration.png", shown.comparisons
    draw(path, (WIDTH, 2.45 * len(comparisons) + 0.3), lambda figure: paint_pit(figure, comparisons))
    alt = f"PIT histograms of {', '.join(c.model for c in comparisons)}."
    return [Picture(path, alt, CALIBRATION_CAPTION)]


def residual_pictures(out: Path, shown: Validation) -> list[Picture]:
    """Observed against predicted outcomes of the main model, and its residuals over time."""
    path, comparison = out / "residuals.png", shown.comparisons[0]
    axis = time_axis(comparison, shown.windows)
    draw(path, (WIDTH, 6.0), lambda figure: paint_residuals(figure, comparison, axis))
    alt = "Observed against predicted displacement per output, and standardised residuals over time."
    return [Picture(path, alt, f"{comparison.model}. {RESIDUAL_CAPTION}")]


def _map_panels(shown: Validation, condition: Condition) -> list[Panel]:
    """The map of each model, the main model at the recorded windows, and the recorded map."""
    rows, outline = condition.rows, shown.models[0].rig.outline
    similar = shown.table.take(rows)
    fine, coarse = fine_cells(outline, similar), coarse_cells(outline, similar)
    main = shown.comparisons[0]
    fixed = [fixed_covariates(model, similar) for model in shown.models]
    velocity, duration = condition.velocity, condition.duration
    panels = [Panel(m.name, push_map(m, velocity, duration, fine, h)) for m, h in zip(shown.models, fixed, strict=True)]
    same = predicted_at_windows(outline, similar, main.mean[rows], main.variance[rows], coarse)
    return [
        *panels,
        Panel(f"{main.model}, at the\nrecorded windows", same),
        Panel("recorded\n(digits: pushes)", recorded_map(outline, similar, main.mean[rows], coarse), counted=True),
    ]


def _mean_caption(condition: Condition, recorded: PushMap) -> str:
    windows = recorded.windows if recorded.windows is not None else np.zeros((1, 1), np.int64)
    filled = windows >= FEWEST
    typical = f", median {np.median(windows[filled]):.0f} windows" if filled.any() else ""
    return (
        f"Mean outcome by contact and push angle. The two panels on the right show the same windows in the same cells: "
        f"where their colours agree, the predicted mean is right. {_of_condition(condition)} The models' own maps are "
        f"evaluated at cell centres. Digits: number of pushes in a cell. Grey, hatched: fewer than {FEWEST} windows in "
        f"the cell ({filled.sum()} of {filled.size} cells are shown{typical}), or outside the training pushes."
    )


def _sd_caption(condition: Condition, main: str) -> str:
    return (
        f"Standard deviation (sd) of the outcome by contact and push angle. Where the two panels on the right agree, "
        f"the predicted uncertainty is right. {_of_condition(condition)} Predicted: sd of an observed outcome, that is "
        f"process noise and model uncertainty. Recorded: root mean square deviation from what {main} predicts for each "
        f"window. So an error of the mean counts, and the variation of the inputs within a cell does not. Errors in "
        f"a push are correlated: a cell of k pushes has an uncertainty of about 1/√(2k), 50 % for two pushes and 25 % "
        f"for eight."
    )


def _fixed_caption(shown: Validation, condition: Condition) -> str:
    """The covariates at which the maps of extended models are drawn, empty without such models."""
    similar, outline = shown.table.take(condition.rows), shown.models[0].rig.outline
    sentences = [fixed_covariates_text(model, fixed_covariates(model, similar)) for model in shown.models]
    extended = [model.name for model in shown.models if model.predictor.effects]
    if extended and (sides := fold_order(outline)) > 1:
        sentences.append(f"Effects may differ between sides: the first of the {sides} equal sides is drawn.")
    return "".join(f" {text}" for text in sentences if text)


def _of_condition(condition: Condition) -> str:
    return (
        f"Only windows at {condition.velocity * 1e3:.3g} mm/s (± 10 %), the most common speed, and of "
        f"{condition.duration:.3g} s are shown ({condition.rows.sum()} of {condition.rows.size} windows)."
    )


def _map_alt(quantity: str, panels: Sequence[Panel]) -> str:
    names = "; ".join(panel.title.replace("\n", " ") for panel in panels)
    return f"Colour maps of the {quantity} of dx, dy and dtheta over contact and push angle: {names}."


def _example_alt(count: int) -> str:
    return f"{count} example pushes: slider outlines before and after, predicted 95 % ellipses and observed outcomes."


def _example_caption(model: str) -> str:
    return (
        f"Up to {EXAMPLES} windows of {model}, each from a different push. About 95 % of the dots should lie in the "
        f"ellipses. Left: the slider before (grey), after (orange) and as predicted (blue, dashed). The pusher moves "
        f"to the right. Middle: predicted 95 % ellipse and observed outcome in the push frame. Right: 95 % interval of "
        f"the rotation. Grey dots: windows with similar inputs (a tenth of the outline, 10°, 10 % of the speed). Each "
        f"is shifted by the difference of the predicted means, so it shows the unexplained part only. The windows are "
        f"chosen by their inputs alone; those with at least {ENOUGH} similar windows are preferred."
    )


CALIBRATION_CAPTION = (
    "A calibrated model has bars in the grey band. Probability integral transform (PIT): predicted probability of a "
    "smaller outcome. A hump: the predicted uncertainty is too large. A trough: it is too small. A slope: the mean is "
    "biased. The band contains 95 % of the bars of a calibrated model; it counts the windows of a push together, since "
    "they resemble each other."
)
RESIDUAL_CAPTION = (
    "A trend whose interval excludes zero is a drift. Top: observed against predicted outcome, with the predicted 95 % "
    "interval (grey). Bottom: residuals in units of the predicted sd, over time. Grey: windows, clipped at the frame; "
    "colour: means of pushes. The band contains 95 % of the windows of a calibrated model. Trend: change of the "
    "residual from the first to the last window, with its 95 % interval from resampling whole pushes."
)
