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
from push_predictor.reporting.canvas import NEARBY, OBSERVED, Picture, draw, grid
from push_predictor.reporting.chart import Bars, Chart, limits_of

if TYPE_CHECKING:
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
PARAMETERS = "Fitted parameters in prior standard deviations from the textbook value, with 95 % intervals."


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
        html.figure(_picture(folder, ladder.final)),
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


def _picture(folder: Path, parameters: list[FittedParameter]) -> Picture:
    size = (6.0, 1.2 + 0.36 * max(len(parameters), 3))
    path = draw(folder / "ladder.png", size, lambda figure: _paint(figure, parameters))
    return Picture(path, "The fitted parameters and their 95 % intervals", PARAMETERS)


def _paint(figure: Figure, parameters: list[FittedParameter]) -> None:
    axes, place = figure.subplots(), range(len(parameters))
    axes.axvline(0.0, color=NEARBY, linewidth=0.8)
    for k, p in enumerate(parameters):
        value, low, high = (
            (end - p.parameter.textbook) / p.parameter.spread
            for end in (p.estimate.value, p.estimate.low, p.estimate.high)
        )
        axes.plot([low, high], [k, k], color=OBSERVED, linewidth=1.6)
        axes.plot(value, k, "o", color=OBSERVED, markersize=4.5)
    axes.set_yticks(place, [p.parameter.name for p in parameters])
    axes.set_ylim(max(len(parameters), 1) - 0.5, -0.5)
    axes.set_xlabel("Prior standard deviations")
    grid(axes)
