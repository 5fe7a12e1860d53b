# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The data: pushes to learn from, and repeated pushes that show the distribution of an outcome."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest

from push_predictor.evaluation.estimate import Estimate
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, IntArray
from push_predictor_paper.claims import LEAST_WINDOWS, SD_KNOWN
from push_predictor_paper.data.corpus import Corpus, learning_spec
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.estimate import exactly
from push_predictor_paper.plan import Plan
from push_predictor_paper.section import Number, Section, Table, speed_text
from push_predictor_paper.study import Study
from push_predictor_paper.verdict import Bound, Evidence, Figure

ENOUGH_SEEN = 0.9  # of the repetitions of a push
NOTES = (
    "The paper learns from the MIT push data set, which is measured. The simulated sets have its shapes, masses, "
    "pusher and speeds. Friction, pressure and their noise are assumptions of the simulator, so results on them say "
    "nothing about real materials.",
    "A window needs 0.2 s of unbroken contact: 10 cm at 500 mm/s. At high speed the slider often leaves the tip. "
    "Windows at high speed are therefore a selection.",
    "The outermost contacts of the grid lie half a millimetre inside the corners.",
)


@dataclass(frozen=True)
class SpeedCount:
    """At one speed (m/s): pushes commanded, pushes with a window, windows; fewest: windows in the poorest set."""

    speed: float
    pushes: int
    with_window: int
    windows: int
    fewest: int

    @property
    def share(self) -> Estimate:
        """Share of the pushes with a window, with Wilson's interval."""
        return share_of(self.with_window, self.pushes)


def section(study: Study) -> Section:
    """Training data by pair and speed; precision of mean and standard deviation from repetitions."""
    counts, grid = speed_counts(study.plan, study.simulated), study.reference_grid
    fewest = min(count.fewest for count in counts)
    sets = [
        Figure("sets", exactly(len(study.simulated.sets))),
        Figure("windows", exactly(fewest), Bound(low=LEAST_WINDOWS)),
    ]
    return Section(
        {"sets": Evidence(sets), "known": known(grid)},
        (*map(_corpus_table, study.corpora), _speed_table(counts), _grid_table(study)),
        notes=(*NOTES, *(note for corpus in study.corpora for note in corpus.notes)),
    )


def share_of(part: int, whole: int) -> Estimate:
    """A share with Wilson's interval."""
    ends = binomtest(part, whole).proportion_ci(method="wilson")
    return Estimate(part / whole, ends.low, ends.high)


def speed_counts(plan: Plan, corpus: Corpus) -> list[SpeedCount]:
    """Count, for each speed of the plan over all pairs: pushes commanded, pushes with a window, windows.

    A push belongs to the commanded speed nearest, as a ratio, to the speed of its first window.
    """
    commanded = np.concatenate([learning_spec(plan, *pair).pushes.speed for pair in corpus.sets])
    pushes, windows = zip(*(_by_speed(plan, pushes.table) for pushes in corpus.sets.values()), strict=True)
    return [
        SpeedCount(
            speed,
            int(np.sum(commanded == speed)),
            int(np.sum(pushes, axis=0)[k]),
            int(np.sum(windows, axis=0)[k]),
            int(np.min(windows, axis=0)[k]),
        )
        for k, speed in enumerate(plan.speeds)
    ]


def known(grid: RepeatedGrid) -> Evidence:
    """Whether the deviations of the grid's pushes are known."""
    widths = np.array([_half_width(cell) for cell in grid.seen]).reshape(-1, 3)
    seen = np.array([len(cell.outcomes) >= ENOUGH_SEEN * cell.commanded for cell in grid.seen], dtype=bool)
    count = int(np.sum(seen & (widths <= SD_KNOWN).all(axis=1)))
    typical = f"±{np.median(widths):.0%}" if len(widths) else "unknown"
    note = (
        f"{len(grid.cells)} pushes on {grid.surface}, {grid.cells[0].commanded} repetitions each, of which "
        f"{ENOUGH_SEEN:.0%} must have a window. Half-width of the interval of a standard deviation, median: {typical}."
    )
    return Evidence([Figure("", share_of(count, len(grid.cells)))], note)


def _by_speed(plan: Plan, table: PushTable) -> tuple[IntArray, IntArray]:
    """Number of pushes and windows (speeds,) of a set at each speed of the plan."""
    _, first, windows = np.unique(table.push_id, return_index=True, return_counts=True)
    away = np.abs(np.log(table.inputs[first, 0])[:, None] - np.log(plan.speeds))
    nearest, count = away.argmin(axis=1), len(plan.speeds)
    return np.bincount(nearest, minlength=count), np.bincount(nearest, windows, minlength=count).astype(np.int64)


def _half_width(cell: Repetitions) -> Array:
    """Half-width (3,) of the interval of each standard deviation, as a share of it."""
    low, high = cell.sd_interval
    return np.asarray((high - low) / 2.0 / cell.sd)


def _corpus_table(corpus: Corpus) -> Table:
    tables = {pair: pushes.table for pair, pushes in corpus.sets.items()}
    rows = tuple((", ".join(pair), len(table.pushes), len(table)) for pair, table in tables.items())
    return Table(f"Training data. {corpus.title}.", ("set", "pushes", "windows"), rows)


def _speed_table(counts: list[SpeedCount]) -> Table:
    rows = tuple((speed_text(c.speed), c.pushes, Number(c.share, ".0%"), c.windows, c.fewest) for c in counts)
    head = ("commanded speed", "pushes", "share with a window", "windows", "windows in the poorest set")
    return Table("Training data by speed, simulated. Shares with Wilson's interval.", head, rows)


def _grid_table(study: Study) -> Table:
    rows = tuple(
        (surface, len(grid.cells), grid.cells[0].commanded, sum(len(c.outcomes) for c in grid.cells), len(grid.seen))
        for surface, grid in study.grids.items()
    )
    head = ("surface", "pushes of the grid", "repetitions of each", "first windows")
    caption = f"Validation data: simulated repetitions, {study.reference_grid.shape}, 1 cm at 20 mm/s."
    return Table(caption, (*head, "pushes with 10 first windows or more"), rows)
