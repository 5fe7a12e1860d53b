# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The residual loop of the demo as numbers and as one picture."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.validation import Comparison, comparison_of, metrics_json
from push_predictor.models.store.model_file import load_model
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.canvas import COLOURS, NEARBY, draw, grid
from push_predictor.residuals.evidence.loading import load_evidence
from push_predictor.residuals.reporting.phrases import interval, shown_unit
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DEPLOYED, EXTENDED = "deployed", "extended"
BLUE, ORANGE = COLOURS[0], COLOURS[1]


@dataclass(frozen=True)
class Story:
    """The numbers of the picture.

    score: by model, (pushes, 2) of push number and mean square of its standardised residual. later: by model, the
    pushes after the trace. traced: how many pushes the trace used. alarm: number of the push at which the alarm fired.
    """

    score: Mapping[str, Array]
    later: Mapping[str, Comparison]
    traced: int
    alarm: int | None

    @property
    def n_later(self) -> int:
        """Pushes after the trace."""
        return int(np.sum(self.score[DEPLOYED][:, 0] >= self.traced))


def story_of(
    model: Path, extended: Path | None, served: str | None, before: Path, after: Path, alarm: Any | None
) -> Story:
    """Read what the validators wrote before and after the trace."""
    first, table = (load_evidence([path / "pushes.csv"]).table for path in (before, after))
    traced = int(np.max(first.covariates["push_index"])) + 1
    files = {DEPLOYED: (model, after / "windows.json")}
    if extended is not None:
        files[EXTENDED] = (extended, after / f"windows_{served}.json")
    scores, later = {}, {}
    for label, (path, windows) in files.items():
        answered = json.loads(windows.read_text())["windows"]
        scores[label] = _scores(answered, table)
        later[label] = _comparison(path, answered, table, traced)
    fired = None if alarm is None else int(alarm.pushes) - 1
    return Story(scores, later, traced, fired)


def draw_story(path: Path, story: Story, verdict: Mapping[str, Any], truth: Mapping[str, Any]) -> Path:
    """Draw the residual of every push with alarm and trace, and both models' error on the pushes after the trace."""

    def paint(figure: Figure) -> None:
        layout: dict[str, Axes] = figure.subplot_mosaic(
            [["story", "story"], ["nmse", "nlpd"]], height_ratios=[2.2, 1.0]
        )
        _paint_story(layout["story"], story, int(truth["from push"]))
        layout["story"].set_title(_title(verdict, truth), loc="left")
        for key, name in (("nmse", "NMSE"), ("nlpd", "NLPD (nats, SI units)")):
            _paint_error(layout[key], story, key, name)

    return draw(path, (9.0, 6.0), paint)


def _scores(answered: list[dict[str, Any]], table: PushTable) -> Array:
    index = dict(zip(table.push_id, table.covariates["push_index"], strict=True))
    of_push: dict[float, list[float]] = {}
    for window in answered:
        left = np.subtract(window["observed"], window["predicted"])
        distance = float(left @ np.linalg.solve(np.reshape(window["covariance"], (3, 3)), left)) / 3.0
        of_push.setdefault(float(index[window["push_id"]]), []).append(distance)
    return np.array([[number, np.mean(each)] for number, each in sorted(of_push.items())])


def _comparison(path: Path, answered: list[dict[str, Any]], table: PushTable, first: int) -> Comparison:
    if len(answered) != len(table):
        raise SystemExit(f"{path.name} predicted {len(answered)} of {len(table)} windows")
    rows = table.covariates["push_index"] >= first
    mean = np.array([window["predicted"] for window in answered])[rows]
    covariance = np.array([window["covariance"] for window in answered]).reshape(-1, 3, 3)[rows]
    model = load_model(path)
    return comparison_of(model, model.continued(table.take(rows)), mean, covariance)


def _paint_story(axes: Axes, story: Story, change: int) -> None:
    last = int(story.score[DEPLOYED][-1, 0])
    for label, colour, marker in ((DEPLOYED, BLUE, "o"), (EXTENDED, ORANGE, "s")):
        if label not in story.score:
            continue
        score = story.score[label]
        if label == EXTENDED:
            score = score[score[:, 0] >= story.traced]
        axes.semilogy(*score.T, marker, color=colour, markersize=3.0, alpha=0.45, linestyle="none")
        axes.semilogy(*_running(score, (0, change, story.traced)), color=colour, linewidth=1.8, label=f"{label} model")
    axes.axhline(1.0, color=NEARBY, linewidth=0.8, linestyle=":")
    _mark(axes, change, "hidden change begins", "--", 0.98)
    _mark(
        axes,
        story.traced,
        "cause traced, extended model loaded" if EXTENDED in story.score else "cause traced",
        "-",
        0.98,
    )
    if story.alarm is not None:
        _mark(axes, story.alarm, f"alarm (after {story.alarm + 1} pushes)", "-", 0.90)
    axes.set(
        xlabel="push",
        xlim=(-2, last + 2),
        ylabel="mean squared standardised residual\nof a push (calibrated: 1 on average)",
    )
    axes.legend(loc="lower center", ncols=2)
    grid(axes)


def _mark(axes: Axes, place: float, text: str, style: str, height: float) -> None:
    axes.axvline(place - 0.5, color="black", linewidth=0.9, linestyle=style)
    axes.text(place + 1.0, height, text, transform=axes.get_xaxis_transform(), va="top", fontsize=8.0,
              bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0})  # fmt: skip


def _running(score: Array, cuts: tuple[int, ...]) -> tuple[Array, Array]:
    """Running geometric mean over 15 pushes, interrupted at the cuts."""
    x, y = [], []
    for begin, end in zip(cuts, (*cuts[1:], np.inf), strict=True):
        part = score[(score[:, 0] >= begin) & (score[:, 0] < end)]
        for k in range(len(part)):
            near = part[max(0, k - 7) : k + 8]
            x.append(part[k, 0])
            y.append(float(np.exp(np.mean(np.log(near[:, 1])))))
        x.append(np.nan)
        y.append(np.nan)
    return np.array(x), np.array(y)


def _paint_error(axes: Axes, story: Story, key: str, name: str) -> None:
    for row, (label, comparison) in enumerate(story.later.items()):
        score: dict[str, Any] = metrics_json(comparison)
        value, span = score[key]["total"], score["interval"][key]
        colour = BLUE if label == DEPLOYED else ORANGE
        axes.errorbar(
            value, row, xerr=[[value - span["low"]], [span["high"] - value]], fmt="o", color=colour, capsize=3.0
        )
        axes.annotate(
            f"{value:.2f}".replace("-", "−"),
            (value, row),
            xytext=(0, 6),
            textcoords="offset points",
            ha="center",
            color=colour,
        )
    axes.set(
        xlabel=f"{name}, the {story.n_later} pushes after the trace",
        yticks=range(len(story.later)),
        yticklabels=list(story.later),
    )
    axes.margins(x=0.12)
    axes.set_ylim(len(story.later) - 0.5, -0.7)
    grid(axes)


def _title(verdict: Mapping[str, Any], truth: Mapping[str, Any]) -> str:
    found = "\n    and ".join(effect_in_words(effect) for effect in verdict["effects"]) or "no effect"
    hidden = f"{_words(truth['mechanism'])} {_number(truth['value'])} {_unit(truth['unit'])}".strip()
    return f"Found by the trace: {found}\nHidden until the end: {hidden} (the simulator's own parameter)"


def effect_in_words(effect: Mapping[str, Any]) -> str:
    """An effect in words: contact friction, changes with elapsed time (step), 0.25 (95 % CI 0.20 to 0.30)."""
    name = f"{_words(effect['mechanism'] or 'unknown mechanism')}, {_dependence(effect)}"
    size = effect["parameter"]
    if size is None:
        return name
    factor, unit = shown_unit(size["unit"])
    return f"{name}, {interval(Estimate(size['value'], size['low'], size['high']).times(factor), unit)}"


def _dependence(effect: Mapping[str, Any]) -> str:
    if effect["form"] == "constant":
        return "constant"
    return f"changes with {_words(effect['covariate'])} ({_words(effect['form'])})"


def _words(identifier: str) -> str:
    return identifier.replace("_", " ")


def _number(value: float) -> str:
    return f"{value:.3g}".replace("-", "−")


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit
