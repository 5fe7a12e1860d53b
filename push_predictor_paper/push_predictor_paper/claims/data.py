# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Claims about the data: pushes to learn from, and repeated pushes that show the distribution of an outcome."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.stats import binomtest

from push_predictor.recordings.table import PushTable
from push_predictor.reporting.canvas import Picture, draw
from push_predictor.types import Array, IntArray
from push_predictor_paper.data.corpus import Corpus, learning_spec
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.estimate import Estimate
from push_predictor_paper.figures.data import SpeedCount, paint_data
from push_predictor_paper.plan import Plan
from push_predictor_paper.section import Finding, Section, Table, Verdict
from push_predictor_paper.study import Study

ENOUGH_WINDOWS = 10  # at every speed, of every pair
ENOUGH_SEEN = 0.9  # of the repetitions of a push
WELL_KNOWN = 0.25  # largest half-width of an interval, as a share of the standard deviation
HALF = 0.5  # of the pushes
PAPER_SETS = 16


def section(study: Study) -> Section:
    """Training data by pair and speed; precision of mean and standard deviation from repetitions."""
    counts = speed_counts(study.plan, study.simulated)
    return Section(
        key="data",
        title="The data",
        findings=(_learning_finding(study, counts), grid_finding(study.reference_grid)),
        tables=(*(_corpus_table(corpus) for corpus in study.corpora), _grid_table(study)),
        pictures=(_picture(study, counts),),
        notes=(*NOTES, *(note for corpus in study.corpora for note in corpus.notes)),
        data=_json(study, counts),
    )


def _picture(study: Study, counts: list[SpeedCount]) -> Picture:
    reference = study.simulated.sets[study.simulated.reference]
    path = draw(
        study.out / "data.png",
        (10.0, 3.4),
        lambda figure: paint_data(figure, counts, reference, study.reference_grid),
    )
    return Picture(
        path,
        "Pushes with a window by speed, inputs of the reference set, repetitions with a window over the grid",
        "Left: share of pushes at each speed with at least one window of 0.2 s, all simulated sets, 95 % Wilson "
        "intervals. Middle: contact and angle of every window of the reference set. Right: share of the repetitions of "
        "each push of the grid with a first window.",
    )


def _json(study: Study, counts: list[SpeedCount]) -> dict[str, Any]:
    return {
        "sets": {
            corpus.title: {"/".join(pair): _counts(corpus, pair) for pair in corpus.sets} for corpus in study.corpora
        },
        "speeds": [
            {"speed": c.speed, "pushes": c.pushes, "with_window": c.with_window, "windows": c.windows} for c in counts
        ],
    }


NOTES = (
    "The paper learns from the MIT push data set, which is measured. The simulated sets have its shapes, masses, "
    "pusher and speeds. Friction, pressure and their noise are assumptions of the simulator, so results on them say "
    "nothing about real materials.",
    "A window needs 0.2 s of unbroken contact: 10 cm at 500 mm/s. At high speed the slider often leaves the tip. "
    "Windows at high speed are therefore a selection.",
    "The outermost contacts of the grid lie half a millimetre inside the corners.",
)


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


def _by_speed(plan: Plan, table: PushTable) -> tuple[IntArray, IntArray]:
    """Number of pushes and windows (speeds,) of a set at each speed of the plan."""
    _, first, windows = np.unique(table.push_id, return_index=True, return_counts=True)
    away = np.abs(np.log(table.inputs[first, 0])[:, None] - np.log(plan.speeds))
    nearest, count = away.argmin(axis=1), len(plan.speeds)
    return np.bincount(nearest, minlength=count), np.bincount(nearest, windows, minlength=count).astype(np.int64)


def _learning_finding(study: Study, counts: list[SpeedCount]) -> Finding:
    pairs, speeds = len(study.simulated.sets), study.plan.speeds
    poor = [c for c in counts if c.fewest < ENOUGH_WINDOWS]
    share = binomtest(counts[-1].with_window, counts[-1].pushes).proportion_ci(method="wilson")
    share_text = Estimate(counts[-1].with_window / counts[-1].pushes, share.low, share.high).text(".0%")
    lacking = f"at {', '.join(f'{c.speed * 1e3:.0f}' for c in poor)} mm/s some set has fewer" if poor else "all have"
    shapes, surfaces = (len({pair[k] for pair in study.simulated.sets}) for k in (0, 1))
    return Finding(
        "Pushes at 10 to 500 mm/s of four shapes on four surfaces to learn from",
        _learning_verdict(pairs, len(poor), len(counts)),
        f"{pairs} of the paper's {PAPER_SETS} sets, shapes: {shapes}, surfaces: {surfaces}, at {len(speeds)} speeds "
        f"from {speeds[0] * 1e3:.0f} to {speeds[-1] * 1e3:.0f} mm/s, simulated. {ENOUGH_WINDOWS} windows per set and "
        f"speed are required: {lacking}. At {speeds[-1] * 1e3:.0f} mm/s {share_text} of the pushes stayed in contact "
        f"for a window. Rule: holds if all {PAPER_SETS} sets have enough windows at every speed; does not hold if a "
        "set has too few at half of the speeds or more; else in part.",
        number=f"{pairs} of {PAPER_SETS} sets; enough windows at {len(counts) - len(poor)} of {len(counts)} speeds",
    )


def _learning_verdict(sets: int, poor: int, speeds: int) -> Verdict:
    if 2 * poor >= speeds:
        return "does not hold"
    return "holds" if sets >= PAPER_SETS and not poor else "holds in part"


def grid_finding(grid: RepeatedGrid) -> Finding:
    """Whether the grid has the paper's size and the deviations of its pushes are known."""
    widths = np.array([_half_width(cell) for cell in grid.seen]).reshape(-1, 3)
    seen = np.array([len(cell.outcomes) >= ENOUGH_SEEN * cell.commanded for cell in grid.seen], dtype=bool)
    given = int(np.sum(seen & (widths <= WELL_KNOWN).all(axis=1)))
    interval = binomtest(given, len(grid.cells)).proportion_ci(method="wilson")
    share = Estimate(given / len(grid.cells), interval.low, interval.high)
    typical = f"±{np.median(widths):.0%}" if len(widths) else "unknown"
    return Finding(
        "Repeated pushes determine the mean and the standard deviation of each push",
        _grid_verdict(share),
        f"{share.text('.0%')} of {len(grid.cells)} pushes on {grid.surface} are determined, by "
        f"{grid.cells[0].commanded} repetitions each. Half-width of the interval of a standard deviation, median: "
        f"{typical}; of a Gaussian: ±{1.96 / np.sqrt(2.0 * grid.cells[0].commanded):.0%}. Rule: a push is determined "
        f"if that half-width is at most {WELL_KNOWN:.0%} in all three outputs (repetitions resampled), and "
        f"{ENOUGH_SEEN:.0%} of the repetitions gave a first window ({np.sum(seen) / len(grid.cells):.0%} of the "
        f"pushes). Holds if the interval of that share lies above {ENOUGH_SEEN:.0%}; in part if it begins above "
        f"{HALF:.0%}; does not hold if it ends below {HALF:.0%}; else not decided.",
        number=f"{share.text('.0%')} of {len(grid.cells)} pushes",
    )


def _half_width(cell: Repetitions) -> Array:
    """Half-width (3,) of the interval of each standard deviation, as a share of it."""
    return np.asarray((cell.intervals[1][1] - cell.intervals[1][0]) / 2.0 / cell.sd)


def _grid_verdict(share: Estimate) -> Verdict:
    if share.low > ENOUGH_SEEN:
        return "holds"
    if share.low > HALF:
        return "holds in part"
    return "does not hold" if share.high < HALF else "not decided"


def _corpus_table(corpus: Corpus) -> Table:
    rows = [
        (f"{shape}, {surface}", *map(str, _counts(corpus, (shape, surface)).values())) for shape, surface in corpus.sets
    ]
    return Table(f"Training data. {corpus.title}.", ("set", "pushes", "windows"), tuple(rows))


def _counts(corpus: Corpus, pair: tuple[str, str]) -> dict[str, int]:
    table = corpus.sets[pair].table
    return {"pushes": len(table.pushes), "windows": len(table)}


def _grid_table(study: Study) -> Table:
    rows = []
    for surface, grid in study.grids.items():
        seen = np.array([len(cell.outcomes) for cell in grid.cells])
        rows.append((surface, str(len(grid.cells)), str(grid.cells[0].commanded), f"{seen.sum()}", str(len(grid.seen))))
    head = (
        "surface",
        "pushes of the grid",
        "repetitions of each",
        "first windows",
        "pushes with 10 first windows or more",
    )
    return Table(f"Validation data: simulated repetitions, {grid.shape}, 1 cm at 20 mm/s.", head, tuple(rows))
