# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ladder as one self-contained HTML page, as lines of text and as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.judgement import FEWEST
from push_predictor.evaluation.scored_ladder import FittedParameter, ScoredLadder, ScoredStep, changed
from push_predictor.recordings.atomic import write_whole
from push_predictor.reporting import html
from push_predictor.reporting.chart import Bars, Chart, limits_of
from push_predictor.reporting.html import number

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
COLUMNS = ("step", "free parameters", "held-out NMSE", "held-out NLPD", "gain, nats per push")


def write_ladder_page(path: Path, ladder: ScoredLadder) -> Path:
    """Write the page; return its path. Raises OSError, or PushPredictorError without Jinja2."""
    write_whole(path, html.page(f"Fitted mechanics of the model {ladder.model.name}", _parts(ladder)).encode())
    return path


def _parts(ladder: ScoredLadder) -> list[str]:
    label = "textbook values" if len(ladder.steps) == 1 else f"{len(ladder.final)} fitted"
    steps = [(f"{row[0]}  {row[1]}", *row[2:]) for row in ladder_rows(ladder)]
    head = ["Step and free parameters", *(column[0].upper() + column[1:] for column in COLUMNS[2:])]
    return [
        html.opening(ladder_answer(ladder), label, html.charts([error_chart(ladder)], ERROR)),
        html.heading("Fitted parameters"),
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


def ladder_answer(ladder: ScoredLadder) -> tuple[str, str, str]:
    """What the fit brings, on which evidence, what to do: one sentence each."""
    first, last, number = ladder.steps[0], ladder.steps[-1], len(ladder.final)
    score = "Score it on other pushes with `push_predictor evaluate`."
    if len(ladder.steps) == 1:
        suffice = "The textbook values suffice: no fitted parameter clearly improves the prediction of held-out pushes."
        return suffice, f"Their NMSE is {first.nmse.text('.3f')}, from {count(ladder)}.", f"Use this model. {score}"
    share = 100.0 * (1.0 - last.nmse.value / first.nmse.value)
    fitted = html.count(number, "fitted parameter reduces", "fitted parameters reduce")
    pushes = html.count(ladder.pushes, "push is", "pushes are")
    few = f"Only {pushes} behind the choice. Record at least {FEWEST} and fit again."
    return (
        f"{fitted} the squared error of held-out pushes by {share:.0f} %.",
        f"Their NMSE falls from {first.nmse.text('.3f')} to {last.nmse.text('.3f')}, from {count(ladder)}.",
        few if ladder.pushes < FEWEST else f"Use this model. {score}",
    )


def ladder_lines(ladder: ScoredLadder) -> list[str]:
    """The answer, the ladder as a table, and the fitted parameters with intervals."""
    table = [COLUMNS, *ladder_rows(ladder)]
    widths = [max(len(row[k]) for row in table) for k in range(len(COLUMNS))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in table]
    return [
        *ladder_answer(ladder),
        "",
        *lines,
        f"Each push is predicted from other pushes, in at most ten folds ({count(ladder)}). Brackets: 95 % intervals.",
        "",
        f"Parameters fitted to all {len(ladder.model.training)} windows, with 95 % intervals over pushes:",
        *parameter_lines(ladder.final),
    ]


def ladder_rows(ladder: ScoredLadder) -> list[tuple[str, ...]]:
    """A row of text for each step."""
    return [_row(number, step) for number, step in enumerate(ladder.steps)]


def parameter_lines(parameters: list[FittedParameter]) -> list[str]:
    """A line for each parameter: value, interval, unit and meaning."""
    if not parameters:
        return ["  none: all parameters keep their textbook values"]
    cells = [(p.parameter.name, interval(p.estimate), unit(p)) for p in parameters]
    widths = [max(len(cell[k]) for cell in cells) for k in range(3)]
    return [
        "  " + "  ".join([*(c.ljust(w) for c, w in zip(cell, widths, strict=True)), p.parameter.meaning])
        for cell, p in zip(cells, parameters, strict=True)
    ]


def interval(estimate: Estimate, digits: int = 3) -> str:
    """Value and interval: 0.12 (0.10 to 0.14)."""
    return f"{number(estimate.value, digits)} ({number(estimate.low, digits)} to {number(estimate.high, digits)})"


def unit(fitted: FittedParameter) -> str:
    """The unit of a parameter, a dash for a pure number."""
    return "–" if fitted.parameter.unit == "1" else fitted.parameter.unit


def count(ladder: ScoredLadder) -> str:
    """The windows of the search in words."""
    return f"{ladder.windows} windows of {html.count(ladder.pushes, 'push', 'pushes')}"


def ladder_json(ladder: ScoredLadder) -> dict[str, Any]:
    """The ladder as docs/reference/json.md describes it."""
    return {
        "model": ladder.model.name,
        "search": {"windows": ladder.windows, "pushes": ladder.pushes},
        "fit": {"windows": len(ladder.model.training), "pushes": ladder.model.provenance.pushes},
        "steps": [_step_json(step) for step in ladder.steps],
        "parameters": [_parameter_json(parameter) for parameter in ladder.final],
    }


def _row(number: int, step: ScoredStep) -> tuple[str, ...]:
    gain = "" if step.gain is None else step.gain.text(".2f")
    change = step.change if number == 0 or not step.rung.added or step.rung.dropped else f"+ {step.change}"
    return str(number), change, step.nmse.text(".3f"), step.nlpd.text(".2f"), gain


def _step_json(step: ScoredStep) -> dict[str, Any]:
    return {
        "added": list(step.rung.added),
        "dropped": list(step.rung.dropped),
        "parameters": [_parameter_json(parameter) for parameter in step.parameters],
        "held_out": {"nmse": step.nmse.json(), "nlpd": step.nlpd.json()},
        "gain": None if step.gain is None else step.gain.json(),
        "rivals": [changed(rival.added, rival.dropped) for rival in step.rung.rivals],
    }


def _parameter_json(fitted: FittedParameter) -> dict[str, Any]:
    parameter = fitted.parameter
    known = {name: getattr(parameter, name) for name in ("name", "unit", "textbook", "part", "meaning")}
    return {**known, **fitted.estimate.json()}
