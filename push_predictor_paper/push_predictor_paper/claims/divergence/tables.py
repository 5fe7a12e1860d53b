# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of the KL divergence of models from repeated pushes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from push_predictor.types import Array
from push_predictor_paper.claims.divergence.models import (
    DRAWN,
    SPEED_TOLERANCE,
    Found,
    Training,
    slow_windows,
)
from push_predictor_paper.claims.divergence.rules import STATISTICS, Divergences, by_seed, estimate
from push_predictor_paper.figures.divergence import NAMES
from push_predictor_paper.fits.fit import KINDS
from push_predictor_paper.plan import GRID_SPEED
from push_predictor_paper.section import Table
from push_predictor_paper.statistics.grid_maps import mean_of, median_of
from push_predictor_paper.study import Study

PAPER = {"gp": ("22.63", "5.74"), "vhgp": ("15.32", "5.34")}
HEAD = (
    "model",
    "mean KL",
    "median KL",
    "mean, formula as printed",
    "median, formula as printed",
    "mean KL over seeds",
    "median KL over seeds",
    "paper: mean (other data)",
    "paper: median (other data)",
)


def main_table(study: Study, training: Training, of: Mapping[str, Divergences], floor: float) -> Table:
    """The paper's table, its figures next to ours."""
    pushes, again = len(study.reference_grid.seen), study.plan.repetitions
    rows = []
    for kind in KINDS:
        d = of[kind]
        cells = [
            estimate(values, s, d.weights).cell() for values in (d.correct, d.printed) for s in STATISTICS.values()
        ]
        rows.append((NAMES[kind], *cells, *_seed_range(d.correct), *PAPER.get(kind, ("–", "–"))))
    rows.append(("a perfect model", f"{floor:.3f}", *("–",) * 7))
    caption = (
        f"KL (nats, three outputs) of models from {pushes} simulated pushes of the grid, {again} repetitions each. "
        f"Models of {training.n} windows of all speeds of {' on '.join(study.simulated.reference)}, none of the grid; "
        f"mean of {study.plan.seeds} seeds. Beneath: 95 % interval from resampling blocks of neighbouring pushes. Over "
        "seeds: least to largest. A perfect model: the expected KL with so many repetitions."
    )
    return Table(caption, HEAD, tuple(rows))


def _seed_range(values: Array) -> tuple[str, str]:
    ends = [by_seed(values, statistic) for statistic in STATISTICS.values()]
    mean, median = (f"{each.min():.2f} to {each.max():.2f}" for each in ends)
    return mean, median


def training_table(study: Study, found: Sequence[Found]) -> Table:
    """The effect of other training windows, in total and by means and sds."""
    rows = []
    for training, of in found:
        for kind in KINDS:
            d = of[kind]
            ratios = " / ".join(f"{r:.2f}" for r in np.median(d.sd_ratio, axis=(0, 1)))
            parts = ((d.correct, mean_of), (d.correct, median_of), (d.of_mean, mean_of), (d.of_sd, mean_of))
            figures = (estimate(values, statistic, d.weights).cell() for values, statistic in parts)
            rows.append((f"{training.name}, {training.n} windows: {NAMES[kind]}", *figures, ratios))
    head = (
        "trained on",
        "mean KL",
        "median KL",
        "mean KL of wrong means",
        "mean KL of wrong sds",
        "sd predicted / seen, median (dx / dy / rotation)",
    )
    caption = (
        "The effect of the training speeds. Simulated; pushes and intervals as above. Models of windows of all speeds, "
        f"{_slow_words(study)}, and of as few windows of all speeds."
    )
    return Table(caption, head, tuple(rows))


def _slow_words(study: Study) -> str:
    within = f"only from those within {SPEED_TOLERANCE:.0%} of the grid's {GRID_SPEED * 1e3:.0f} mm/s"
    return f"{within} (there are {len(slow_windows(study))}; {DRAWN:.0%} of them drawn, {study.plan.seeds} seeds)"
