"""All candidates: a row for each mechanism, a column for each covariate, coloured by the family-wise p."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.reporting.canvas import EMPTY
from push_predictor.residuals.outcome import Tested, Trace
from push_predictor.residuals.reporting.phrases import covariate_phrase, label, mechanism_phrase
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FLOOR = 1e-3  # p values below it share a colour


def paint_tested(figure: Figure, trace: Trace) -> None:
    """Paint the smallest p of each pair; a ring marks an effect found, a dot a rival of the first."""
    from matplotlib.colors import LogNorm

    rows, columns, p = grid_of(trace.tested)
    ax = figure.subplots()
    ax.set_facecolor(EMPTY)
    image = ax.pcolormesh(np.arange(len(columns) + 1), np.arange(len(rows) + 1), p, cmap="viridis",
                          norm=LogNorm(FLOOR, 1.0), edgecolors="white", linewidth=0.5)  # fmt: skip
    for tested in best_of(trace.tested):
        place = columns.index(_column(tested)) + 0.5, rows.index(_row(tested)) + 0.5
        if (mark := role_of(trace, tested)) == "found":
            ax.plot(*place, "o", mfc="none", mec="#D55E00", markersize=11.0, mew=2.2)
        elif mark == "rival":
            ax.plot(*place, "o", color="white", mec="#D55E00", markersize=6.5, mew=1.2)
    ax.set_xticks(np.arange(len(columns)) + 0.5, columns, rotation=55, ha="right", rotation_mode="anchor")
    ax.set_yticks(np.arange(len(rows)) + 0.5, rows)
    ax.tick_params(length=0.0)
    ax.invert_yaxis()
    bar = figure.colorbar(image, label="Family-wise p", pad=0.01, aspect=22, extend="min")
    bar.ax.axhline(max(trace.alpha, FLOOR), color="#D55E00", linewidth=1.6)


def best_of(tested: Sequence[Tested]) -> list[Tested]:
    """One candidate for each mechanism and covariate, that with the smallest p; the smallest first."""
    best: dict[tuple[str | None, str], Tested] = {}
    for each in sorted(tested, key=lambda t: t.p_value):
        best.setdefault((each.mechanism, each.covariate), each)
    return list(best.values())


def role_of(trace: Trace, tested: Tested) -> str:
    """The role of a candidate: "found", "rival" (of the first effect) or ""."""
    if any((tested.mechanism, tested.covariate) == (e.mechanism, e.covariate) for e in trace.effects):
        return "found"
    if not trace.effects:
        return ""
    first = trace.effects[0]
    covariate = tested.covariate in (first.covariate, *trace.equivalent)
    mechanism = tested.mechanism in (first.mechanism, *trace.mechanisms)
    return "rival" if covariate and mechanism else ""


def grid_of(tested: Sequence[Tested]) -> tuple[list[str], list[str], Array]:
    """Phrases of mechanisms (r,) and covariates (c,), and the smallest p (r, c), NaN for a pair that was not tried."""
    best = best_of(tested)
    rows = list(dict.fromkeys(_row(each) for each in sorted(best, key=lambda t: t.p_value)))
    columns = list(dict.fromkeys(_column(each) for each in best))
    p = np.full((len(rows), len(columns)), np.nan)
    for each in best:
        p[rows.index(_row(each)), columns.index(_column(each))] = max(each.p_value, FLOOR)
    return rows, columns, p


def _row(tested: Tested) -> str:
    return label(mechanism_phrase(tested.mechanism))


def _column(tested: Tested) -> str:
    return label(covariate_phrase(tested.covariate))
