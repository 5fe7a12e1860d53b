# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ladder as one self-contained HTML page with a picture."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.ladder.ladder_text import COLUMNS, count, interval, ladder_answer, ladder_rows, unit
from push_predictor.evaluation.ladder.scored_ladder import FittedParameter, ScoredLadder
from push_predictor.recordings.atomic import write_whole
from push_predictor.reporting import html
from push_predictor.reporting.canvas import NEARBY, OBSERVED, PREDICTED, Picture, draw, grid
from push_predictor.reporting.chart import Bars, Chart, limits_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PARAMETER_HEAD = ("Meaning", "Value", "Unit", "Textbook", "Parameter")
METHOD = (
    "Each step adds the parameter that most improves the log density of held-out pushes.",
    "Where no single parameter helps, a step adds a pair, or replaces one parameter by one or two.",
    "A step must gain more than one standard error, estimated from the variation between pushes.",
    "It must also gain 5 nats for each added parameter, or 0.03 nats per push if that is more.",
    "All free parameters are fitted together at each step, with heavy-tailed noise and weak priors.",
    "The same pushes choose and score the steps, so the scores are slightly optimistic. "
    "Score the model on other pushes with push_predictor evaluate.",
)

ERROR = (
    "Total NMSE of held-out pushes after each step, with 95 % intervals. Step 0 has the textbook values. Hover over a "
    "point to see what its step adds."
)


def write_ladder_page(path: Path, ladder: ScoredLadder) -> Path:
    """Write the page; return its path. Raises OSError, or PushPredictorError without matplotlib or Jinja2."""
    with TemporaryDirectory() as folder:
        parts = _parts(Path(folder), ladder)
    write_whole(path, html.page(f"Fitted mechanics of the model {ladder.model.name}", parts).encode())
    return path


def _parts(folder: Path, ladder: ScoredLadder) -> list[str]:
    steps = [(f"{row[0]}  {row[1]}", *row[2:]) for row in ladder_rows(ladder)]
    head = ["Step and free parameters", *(column[0].upper() + column[1:] for column in COLUMNS[2:])]
    parts = [
        html.opening(ladder_answer(ladder), _label(ladder), html.charts([error_chart(ladder)], ERROR)),
        html.heading("Fitted parameters"),
        html.figure(_picture(folder, ladder)),
        html.folded_table(
            "Fitted parameters. Values with 95 % intervals from the variation between pushes.",
            PARAMETER_HEAD,
            _parameter_rows(ladder),
        ),
        html.heading("Steps"),
        html.folded_table(f"Scores by cross-validation over whole pushes: {count(ladder)}.", head, steps),
        html.heading("Method"),
        html.bullets(METHOD),
    ]
    return parts


def error_chart(ladder: ScoredLadder) -> Chart:
    """The held-out squared error after each step, with 95 % intervals."""
    ends = np.array([[step.nmse.value, step.nmse.low, step.nmse.high] for step in ladder.steps])
    number, names = (
        np.arange(len(ends), dtype=np.float64),
        [f"{k}: {step.change}" for k, step in enumerate(ladder.steps)],
    )
    return Chart(
        label="Squared error of held-out pushes after each step of the ladder",
        x_label="step",
        y_label="held-out NMSE",
        x=(-0.5, len(ends) - 0.5),
        y=(0.0, limits_of(ends)[1]),
        marks=(Bars("fit", number, ends[:, 0], ends[:, 1], ends[:, 2], names),),
        names={float(k): str(k) for k in number.astype(int)},
    )


def _label(ladder: ScoredLadder) -> str:
    return "textbook values" if len(ladder.steps) == 1 else f"{len(ladder.final)} fitted"


def _parameter_rows(ladder: ScoredLadder) -> list[tuple[str, ...]]:
    return [
        (
            p.parameter.meaning,
            interval(p.estimate).replace(" (", "\n("),
            unit(p),
            html.number(p.parameter.textbook, 3),
            p.parameter.name,
        )
        for p in ladder.final
    ]


def _picture(folder: Path, ladder: ScoredLadder) -> Picture:
    height = 1.2 + 0.36 * max(len(ladder.steps), len(ladder.final), 3)
    path = draw(folder / "ladder.png", (9.5, height), lambda figure: _paint(figure, ladder))
    caption = (
        "Left and middle: total NMSE and NLPD of held-out pushes after each step, with 95 % intervals. "
        "Right: fitted parameters in prior standard deviations from the textbook value."
    )
    return Picture(path, "Held-out scores by step of the ladder, and the fitted parameters", caption)


def _paint(figure: Figure, ladder: ScoredLadder) -> None:
    nmse, nlpd, fitted = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.2))
    steps = [
        f"{k}  {row[1]}".replace(" in place of ", "\n   in place of ") for k, row in enumerate(ladder_rows(ladder))
    ]
    for axes, name in ((nmse, "nmse"), (nlpd, "nlpd")):
        estimates = [getattr(step, name) for step in ladder.steps]
        _intervals(axes, np.array([[e.value, e.low, e.high] for e in estimates]), PREDICTED)
        axes.set_yticks(range(len(steps)), steps if axes is nmse else [""] * len(steps))
        axes.set_ylim(len(steps) - 0.5, -0.5)
        axes.locator_params(axis="x", nbins=4)
        axes.set_xlabel(f"Held-out {name.upper()}" + (" (nats)" if name == "nlpd" else ""))
    _paint_parameters(fitted, ladder.final)


def _paint_parameters(axes: Axes, parameters: list[FittedParameter]) -> None:
    axes.axvline(0.0, color=NEARBY, linewidth=0.8)
    if parameters:
        scaled = [
            [
                (end - p.parameter.textbook) / p.parameter.spread
                for end in (p.estimate.value, p.estimate.low, p.estimate.high)
            ]
            for p in parameters
        ]
        _intervals(axes, np.array(scaled), OBSERVED)
    axes.set_yticks(range(len(parameters)), [p.parameter.name for p in parameters])
    axes.set_ylim(max(len(parameters), 1) - 0.5, -0.5)
    axes.set_xlabel("Prior standard deviations")


def _intervals(axes: Axes, ends: np.ndarray, colour: str) -> None:
    """Draw values with intervals (k, 3: value, low, high), one per line."""
    place = np.arange(len(ends))
    axes.hlines(place, ends[:, 1], ends[:, 2], color=colour, linewidth=1.6)
    axes.plot(ends[:, 0], place, "o", color=colour, markersize=4.5)
    grid(axes)
