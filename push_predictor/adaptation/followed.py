# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A recording followed push by push: each push is predicted, then taken in; the errors and parameters on the way."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from push_predictor.adaptation.adaptation import Adaptation, AdaptedParameter
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.evaluation.validation import compare
from push_predictor.models.push_model import PushModel
from push_predictor.models.request import check_pushes
from push_predictor.recordings.table import PushTable
from push_predictor.reporting.canvas import COLOURS, draw
from push_predictor.types import Array
from push_predictor.watch import Watch, no_watch

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STAGES = (0, 10, 30, 100)  # pushes taken in at which a column of the table begins
SHOWN = 3  # parameters in the picture: those that changed most, in units of their uncertainty
SMOOTHED = 10  # pushes of a point of a curve


@dataclass(frozen=True, eq=False)
class Followed:
    """p pushes followed by a model.

    nlpd: by the name of each model, nats per window of each push (p,), before that push was taken in.
    parameters: after each push, those that follow. sentence: what was found.
    """

    nlpd: dict[str, Array]
    parameters: list[list[AdaptedParameter]]
    sentence: str

    @property
    def lines(self) -> list[str]:
        """The mean NLPD of each model by stage, and the parameters at the end, to be printed."""
        count = len(self.parameters)
        ends = [*(stage for stage in STAGES if stage < count), count]
        spans = list(pairwise(ends))
        titles = [f"{low + 1}-{high}" for low, high in spans]
        rows = [f"NLPD of pushes   {''.join(f'{title:>10}' for title in titles)}"]
        for name, values in self.nlpd.items():
            rows.append(f"  {name:<14} {''.join(f'{values[low:high].mean():10.2f}' for low, high in spans)}")
        return [*rows, *(f"  {parameter}" for parameter in self.parameters[-1]), f"adapted: {self.sentence}"]

    @property
    def json(self) -> dict[str, Any]:
        """See docs/reference/json.md."""
        columns = {
            each[0].name: {
                "deployed": each[0].deployed,
                **{end: [getattr(p, end) for p in each] for end in ("value", "low", "high")},
            }
            for each in zip(*self.parameters, strict=True)
        }
        nlpd = {name: values.tolist() for name, values in self.nlpd.items()}
        return {"pushes": len(self.parameters), "nlpd": nlpd, "parameters": columns, "sentence": self.sentence}

    def draw(self, path: Path) -> Path:
        """Draw errors and parameters over the pushes. Raises PushPredictorError without matplotlib."""
        return draw(path, (7.0, 6.0), self._paint)

    def _paint(self, figure: Figure) -> None:
        most = self._most_changed()
        axes = figure.subplots(1 + len(most), 1, sharex=True, height_ratios=[2.0, *[1.0] * len(most)], squeeze=False)
        top = axes[0, 0]
        for (name, values), colour in zip(self.nlpd.items(), COLOURS, strict=False):
            top.plot(np.arange(1, len(values) + 1), _smoothed(values), color=colour, label=name)
        top.set_ylabel(f"NLPD, mean of {SMOOTHED} pushes\n(nats per window)")
        top.legend()
        for ax, k in zip(axes[1:, 0], most, strict=True):
            _paint_parameter(ax, [each[k] for each in self.parameters])
        axes[-1, 0].set_xlabel("pushes")

    def _most_changed(self) -> list[int]:
        last = self.parameters[-1]
        away = [abs(p.value - p.deployed) / max(p.high - p.low, np.finfo(float).tiny) for p in last]
        return sorted(sorted(range(len(last)), key=lambda k: -away[k])[:SHOWN])


def follow(model: PushModel, table: PushTable, extended: PushModel | None = None, watch: Watch = no_watch) -> Followed:
    """Predict every push of a table by the deployed and by the adapted model, then take it in.

    extended: a further model to compare, such as that of a trace. Raises RequestError as Adaptation, and for a push
    that a model cannot predict.
    """
    adaptation = Adaptation(model)
    others = {"deployed": model} | ({"extended": extended} if extended is not None else {})
    nlpd: dict[str, list[float]] = {name: [] for name in ("deployed", "adapted", *others)}
    tables = {name: other.continued(table) for name, other in others.items()}
    for name, other in others.items():
        check_pushes(other, tables[name])
    parameters = []
    for done, push in enumerate(table.pushes):
        watch("pushes", done / len(table.pushes))
        rows = table.push_id == push
        for name, each in {**others, "adapted": adaptation.adapted}.items():
            nlpd[name].append(_nlpd(each, tables.get(name, tables["deployed"]).take(rows)))
        adaptation.update(tables["deployed"].take(rows))
        parameters.append(adaptation.parameters)
    columns = {name: np.array(values) for name, values in nlpd.items()}
    return Followed(columns, parameters, str(adaptation))


def _nlpd(model: PushModel, push: PushTable) -> float:
    """Of a push, nats per window."""
    scores = push_scores(compare(model, push))
    return float(scores.exact_nlpd.sum() / scores.windows.sum())


def _smoothed(values: Array) -> Array:
    """Mean of up to SMOOTHED pushes to each."""
    sums = np.cumsum(np.concatenate([[0.0], values]))
    begins = np.maximum(np.arange(1, len(sums)) - SMOOTHED, 0)
    ends = np.arange(1, len(sums))
    return np.asarray((sums[ends] - sums[begins]) / (ends - begins))


def _paint_parameter(ax: Axes, course: list[AdaptedParameter]) -> None:
    pushes, first = np.arange(1, len(course) + 1), course[0]
    ax.fill_between(pushes, [p.low for p in course], [p.high for p in course], color=COLOURS[1], alpha=0.25, lw=0)
    ax.plot(pushes, [p.value for p in course], color=COLOURS[1])
    ax.axhline(first.deployed, color=COLOURS[0], ls="--")
    unit = "" if first.unit == "1" else f" ({first.unit})"
    ax.set_ylabel(f"{first.name.replace('_', chr(10), 1).replace('_', ' ')}{unit}")
