# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The data: pushes to learn from, and repeated pushes that show the distribution of an outcome."""

from __future__ import annotations

import numpy as np
from scipy.stats import binomtest

from push_predictor.evaluation.estimate import Estimate
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array
from push_predictor_paper.claims import LEAST_WINDOWS, SD_KNOWN
from push_predictor_paper.data.corpus import Corpus
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.estimate import exactly
from push_predictor_paper.plan import Plan
from push_predictor_paper.section import Section, Table
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


def section(study: Study) -> Section:
    """Training data by pair; precision of mean and standard deviation from repetitions."""
    fewest = min(fewest_windows(study.plan, pushes.table) for pushes in study.simulated.sets.values())
    sets = [
        Figure("sets", exactly(len(study.simulated.sets))),
        Figure("windows", exactly(fewest), Bound(low=LEAST_WINDOWS)),
    ]
    return Section(
        {"sets": Evidence(sets), "known": known(study.reference_grid)},
        [_corpus_table(corpus) for corpus in study.corpora],
        notes=(*NOTES, *(note for corpus in study.corpora for note in corpus.notes)),
    )


def fewest_windows(plan: Plan, table: PushTable) -> int:
    """The windows of a set at that speed of the plan that has least.

    A push belongs to the commanded speed nearest, as a ratio, to the speed of its first window.
    """
    _, first, windows = np.unique(table.push_id, return_index=True, return_counts=True)
    away = np.abs(np.log(table.inputs[first, 0])[:, None] - np.log(plan.speeds))
    return int(np.bincount(away.argmin(axis=1), windows, minlength=len(plan.speeds)).min())


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
    ends = binomtest(count, len(grid.cells)).proportion_ci(method="wilson")
    return Evidence([Figure("", Estimate(count / len(grid.cells), ends.low, ends.high))], note)


def _half_width(cell: Repetitions) -> Array:
    """Half-width (3,) of the interval of each standard deviation, as a share of it."""
    low, high = cell.sd_interval
    return np.asarray((high - low) / 2.0 / cell.sd)


def _corpus_table(corpus: Corpus) -> Table:
    tables = {pair: pushes.table for pair, pushes in corpus.sets.items()}
    rows = tuple((", ".join(pair), len(table.pushes), len(table)) for pair, table in tables.items())
    return Table(f"Training data. {corpus.title}.", ("set", "pushes", "windows"), rows)
