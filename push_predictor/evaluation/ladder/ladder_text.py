# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ladder as lines of text and as JSON."""

from __future__ import annotations

from typing import Any

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.judgement import FEWEST
from push_predictor.evaluation.ladder.scored_ladder import FittedParameter, ScoredLadder, ScoredStep, changed
from push_predictor.reporting.html import number

COLUMNS = ("step", "free parameters", "held-out NMSE", "held-out NLPD", "gain, nats per push")


def ladder_answer(ladder: ScoredLadder) -> tuple[str, str, str]:
    """What the fit brings, on which evidence, what to do: one sentence each."""
    first, last, number = ladder.steps[0], ladder.steps[-1], len(ladder.final)
    score = "Score it on other pushes with `push_predictor evaluate`."
    if len(ladder.steps) == 1:
        suffice = "The textbook values suffice: no fitted parameter clearly improves the prediction of held-out pushes."
        return suffice, f"Their NMSE is {first.nmse.text('.3f')}, from {count(ladder)}.", f"Use this model. {score}"
    share = 100.0 * (1.0 - last.nmse.value / first.nmse.value)
    fitted = "1 fitted parameter reduces" if number == 1 else f"{number} fitted parameters reduce"
    pushes = "1 push is" if ladder.pushes == 1 else f"{ladder.pushes} pushes are"
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
    return f"{ladder.windows} windows of {ladder.pushes} {'push' if ladder.pushes == 1 else 'pushes'}"


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
