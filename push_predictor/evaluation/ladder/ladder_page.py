# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ladder as one self-contained HTML page with a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from push_predictor.evaluation.ladder.ladder_text import COLUMNS, count, interval, ladder_answer, ladder_rows, unit
from push_predictor.evaluation.ladder.scored_ladder import ScoredLadder
from push_predictor.recordings.atomic import write_whole
from push_predictor.reporting import html
from push_predictor.reporting.chart import Bars, Chart, Line, limits_of

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
PARAMETERS = (
    "Fitted parameters in prior standard deviations from the textbook value, in the order of the table. Hover over a "
    "point to see its name."
)


def write_ladder_page(path: Path, ladder: ScoredLadder) -> Path:
    """Write the page; return its path. Raises OSError, or PushPredictorError without Jinja2."""
    write_whole(path, html.page(f"Fitted mechanics of the model {ladder.model.name}", _parts(ladder)).encode())
    return path


def _parts(ladder: ScoredLadder) -> list[str]:
    steps = [(f"{row[0]}  {row[1]}", *row[2:]) for row in ladder_rows(ladder)]
    head = ["Step and free parameters", *(column[0].upper() + column[1:] for column in COLUMNS[2:])]
    parts = [
        html.opening(ladder_answer(ladder), _label(ladder), html.charts([error_chart(ladder)], ERROR)),
        html.heading("Fitted parameters"),
        *([html.charts([parameter_chart(ladder)], PARAMETERS)] if ladder.final else []),
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


def parameter_chart(ladder: ScoredLadder) -> Chart:
    """The fitted parameters with 95 % intervals, in prior standard deviations from the textbook value."""
    ends = np.array(
        [[(end - p.parameter.textbook) / p.parameter.spread for end in vars(p.estimate).values()] for p in ladder.final]
    )
    number, titles = np.arange(1.0, len(ends) + 1.0), [p.parameter.name for p in ladder.final]
    x = (0.5, len(ends) + 0.5)
    return Chart(
        label="Fitted parameters in prior standard deviations from the textbook value",
        x_label="parameter",
        y_label="prior standard deviations",
        x=x,
        y=limits_of(ends, np.zeros(1)),
        marks=(Line("zero", np.array(x), np.zeros(2)), Bars("fit", number, ends[:, 0], ends[:, 1], ends[:, 2], titles)),
        names={float(k): f"{k:.0f}" for k in number},
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
