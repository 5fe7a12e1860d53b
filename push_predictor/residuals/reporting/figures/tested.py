"""All that was tried: a mechanism a row, a driver a column, coloured by how little chance makes such a trace."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.reporting.canvas import EMPTY
from push_predictor.residuals.outcome import Tested, Trace
from push_predictor.residuals.reporting.wording import mechanism_words
from push_predictor.types import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FLOOR = 1e-3  # p values below it are shown alike


def paint_tested(figure: Figure, trace: Trace) -> None:
    """The smallest p of each pair; a ring is what was found, a dot a rival that these data cannot tell from it."""
    from matplotlib.colors import LogNorm

    rows, columns, p = grid_of(trace.tested)
    ax = figure.subplots()
    ax.set_facecolor(EMPTY)
    image = ax.pcolormesh(np.arange(len(columns) + 1), np.arange(len(rows) + 1), p, cmap="viridis",
                          norm=LogNorm(FLOOR, 1.0), edgecolors="white", linewidth=0.5)  # fmt: skip
    for tested in best_of(trace.tested):
        place = columns.index(tested.covariate) + 0.5, rows.index(mechanism_words(tested.mechanism)) + 0.5
        if (mark := role_of(trace, tested)) == "found":
            ax.plot(*place, "o", mfc="none", mec="#D55E00", markersize=11.0, mew=2.2)
        elif mark == "rival":
            ax.plot(*place, "o", color="white", mec="#D55E00", markersize=6.5, mew=1.2)
    ax.set_xticks(np.arange(len(columns)) + 0.5, columns, rotation=55, ha="right", rotation_mode="anchor")
    ax.set_yticks(np.arange(len(rows)) + 0.5, rows)
    ax.tick_params(length=0.0)
    ax.invert_yaxis()
    bar = figure.colorbar(image, label="family-wise p", pad=0.01, aspect=22, extend="min")
    bar.ax.axhline(max(trace.alpha, FLOOR), color="#D55E00", linewidth=1.6)


def best_of(tested: Sequence[Tested]) -> list[Tested]:
    """One for each mechanism and driver, of the basis with the smallest p; the smallest first."""
    best: dict[tuple[str | None, str], Tested] = {}
    for each in sorted(tested, key=lambda t: t.p_value):
        best.setdefault((each.mechanism, each.covariate), each)
    return list(best.values())


def role_of(trace: Trace, tested: Tested) -> str:
    """found, rival (of the first effect), or nothing."""
    if any((tested.mechanism, tested.covariate) == (e.mechanism, e.covariate) for e in trace.effects):
        return "found"
    if not trace.effects:
        return ""
    first = trace.effects[0]
    covariate = tested.covariate in (first.covariate, *trace.equivalent)
    mechanism = tested.mechanism in (first.mechanism, *trace.mechanisms)
    return "rival" if covariate and mechanism else ""


def grid_of(tested: Sequence[Tested]) -> tuple[list[str], list[str], Array]:
    """Names of mechanisms (r,) and drivers (c,), and the smallest p (r, c), NaN where a pair was not tried."""
    best = best_of(tested)
    rows = list(dict.fromkeys(mechanism_words(each.mechanism) for each in sorted(best, key=lambda t: t.p_value)))
    columns = list(dict.fromkeys(each.covariate for each in best))
    p = np.full((len(rows), len(columns)), np.nan)
    for each in best:
        p[rows.index(mechanism_words(each.mechanism)), columns.index(each.covariate)] = max(each.p_value, FLOOR)
    return rows, columns, p
