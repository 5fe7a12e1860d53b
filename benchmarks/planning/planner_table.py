# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The runs of a regime as a Markdown table, for planner.py."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array, BoolArray, IntArray

DRAWS = 4000  # of the bootstrap


@dataclass(frozen=True)
class Regime:
    """Goals up to `far` m away, turned by up to `turned` rad; tolerances (m, rad); largest number of pushes."""

    name: str
    far: float
    turned: float
    distance: float
    turn: float | None
    limit: int = 6


@dataclass(frozen=True, eq=False)
class Runs:
    """The result for n goals.

    pushes (n,): number until the goal was reached, limit + 1 if it was not. error (n,): of the last pose, m. promised,
    kept: predicted probability of the pushes with at least the wanted one, and whether they reached the goal.
    """

    pushes: IntArray
    error: Array
    promised: Array
    kept: BoolArray


def table(regime: Regime, runs: Mapping[str, Runs]) -> str:
    """A regime as Markdown; a missed goal counts as limit + 1 pushes."""
    turn = "any heading" if regime.turn is None else f"{regime.turn} rad"
    base = next(iter(runs))
    first = runs[base]
    lines = [
        f"**{regime.name}**: up to {1e3 * regime.far:g} mm and {regime.turned:g} rad away, within "
        f"{1e3 * regime.distance:g} mm, {turn}",
        "",
        f"| covariance | reached in 1 | in 2 | in 3 | in {regime.limit} | pushes | more than {base} "
        "| final error, mm | sure pushes | predicted | reached |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [_line(name, of, regime.limit, None if of is first else first) for name, of in runs.items()]
    return "\n".join(lines) + "\n"


def _line(name: str, runs: Runs, limit: int, first: Runs | None) -> str:
    n, sure = len(runs.pushes), len(runs.kept)
    cells = [
        name,
        *(_share(int(np.sum(runs.pushes <= k)), n) for k in (1, 2, 3, limit)),
        _mean_with_interval(runs.pushes, ".2f"),
        "" if first is None else _mean_with_interval(runs.pushes - first.pushes, "+.2f"),
        f"{1e3 * np.median(runs.error):.2f}",
        str(sure),
        f"{runs.promised.mean():.2f}" if sure else "-",
        _share(int(runs.kept.sum()), sure) if sure else "-",
    ]
    return f"| {' | '.join(cells)} |"


def _share(count: int, n: int) -> str:
    """A share with Wilson's 95 % interval, in percent."""
    z, share = 1.96, count / n
    centre, half = (share + z * z / (2 * n)), z * np.sqrt(share * (1 - share) / n + (z / (2 * n)) ** 2)
    low, high = ((centre + sign * half) / (1 + z * z / n) for sign in (-1, 1))
    return f"{100 * share:.0f} % ({100 * low:.0f} to {100 * high:.0f})"


def _mean_with_interval(values: IntArray, form: str) -> str:
    """A mean over goals and its 95 % interval from resampling goals."""
    rows = np.random.default_rng(0).integers(len(values), size=(DRAWS, len(values)))
    low, high = np.quantile(values[rows].mean(axis=1), [0.025, 0.975])
    return f"{values.mean():{form}} ({low:{form}} to {high:{form}})"
