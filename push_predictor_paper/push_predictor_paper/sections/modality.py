# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Do repeated pushes have more than one mode, and how well does a Gaussian describe them?"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from push_predictor.evaluation.estimate import Estimate, of_draws
from push_predictor.reporting.canvas import SYMBOLS, Picture
from push_predictor.types import Array
from push_predictor_paper.claims import LEVEL
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.estimate import exactly
from push_predictor_paper.fits.fit import Fit
from push_predictor_paper.painters.histograms import WIDTHS, Histogram, paint_histograms, shown_values
from push_predictor_paper.section import OUTPUT_NAMES, Number, Section, Table, TooFewError, picture
from push_predictor_paper.statistics.grid_maps import OF_BLOCKS, block_weights, place_text
from push_predictor_paper.statistics.modes import (
    FAR,
    LogDensities,
    Shape,
    count_with_modes,
    found_at,
    log_densities,
    shape,
)
from push_predictor_paper.study import Study
from push_predictor_paper.verdict import Evidence, Figure

LISTED = 10
NOTES = (
    "Hartigan's dip test measures the distance of the outcomes' distribution from the nearest unimodal one. Its p "
    "value is against the uniform, the unimodal distribution hardest to distinguish from two modes, so that it rejects "
    "bell-shaped outcomes far less often than its level. Each output is tested alone; Holm's correction covers all.",
    "Whether the simulator's noise splits a push into two outcomes is a property of the simulator and proves nothing "
    "about real pushes. The paper shows its modes without a test.",
)


def section(study: Study) -> Section:
    """Tests of unimodality, their power, and the loss of Gaussian densities."""
    grid = study.reference_grid
    if not grid.seen:
        raise TooFewError("No push of the grid has enough repetitions to test for modes.")
    sizes = np.array([len(cell.outcomes) for cell in grid.seen])
    calls = [(np.concatenate([cell.outcomes for cell in grid.seen]), sizes)]
    window, weights = study.work.run("modes of repeated pushes", shape, calls)[0], block_weights(grid.seen)
    of_model = _model(study, grid)
    loss = model_loss(grid.seen, window, of_model)
    power = found_at(FAR, _repetitions(grid), 3 * len(grid.seen), LEVEL)
    return Section(
        {
            "modes": modes(window, power),
            "not_gaussian": not_gaussian(window, weights),
            "gaussian_good": gaussian_good(window, loss, weights),
        },
        (_counts_table(grid, window, weights, loss),),
        (_picture(study, grid, window, of_model),),
        NOTES,
    )


def model_loss(cells: Sequence[Repetitions], at: Shape, of_model: Sequence[LogDensities]) -> Array:
    """Mean log density (p, 3) that the model's Gaussian loses to the better fit to the push itself."""
    model = [logs.gaussian[: len(c.outcomes)].mean(axis=0) for c, logs in zip(cells, of_model, strict=True)]
    return np.asarray(at.own - np.array(model))


def mean_over_pushes(values: Array, weights: Array) -> Estimate:
    """Mean of the finite ones of values (p, k), pushes resampled by weights (d, p); draws without any are skipped."""
    sums, counts = np.nansum(values, axis=1), np.sum(np.isfinite(values), axis=1)
    total = weights @ counts
    drawn = (weights @ sums)[total > 0.0] / total[total > 0.0]
    return of_draws(float(sums.sum() / counts.sum()), drawn)


def modes(of: Shape, power: float) -> Evidence:
    """Does some push have several modes?"""
    count = int((of.several <= LEVEL).any(axis=1).sum())
    note = (
        f"First window; kinds_of_push has the final poses. Two equal modes {FAR:.0f} of their sd apart would be found "
        f"in {power:.0%} of cases, with correction."
    )
    return Evidence([Figure("", count_with_modes(count, power), text=f"{count} of {len(of.dip)}")], note)


def not_gaussian(of: Shape, weights: Array) -> Evidence:
    """Is some push certainly not Gaussian?"""
    certain = int(np.sum(of.normal.min(axis=1) <= LEVEL / of.normal.size))
    share = mean_over_pushes((of.normal <= LEVEL).astype(np.float64), weights)
    gain = mean_over_pushes(of.two - of.one, weights)
    note = (
        f"First window. {share.text('.1%')} of the single tests reject at 5 %. Two Gaussians instead of one change the "
        f"log density of held-out repetitions by {gain.text('+.3f')} nats an outcome."
    )
    return Evidence([Figure("", exactly(certain), text=f"{certain} of {len(of.normal)}")], note)


def gaussian_good(at: Shape, loss: Array, weights: Array) -> Evidence:
    """What does the VHGP's Gaussian lose where there are several modes, else where the dips are largest?"""
    several = at.several <= LEVEL
    largest = np.isin(np.arange(len(loss)), np.argsort(at.dip.min(axis=1))[:LISTED])
    chosen = np.where(several if several.any() else largest[:, None], loss, np.nan)
    where = "with several modes" if several.any() else "largest dips (none has several modes)"
    note = f"Over all {len(loss)} pushes {mean_over_pushes(loss, weights).text()}."
    return Evidence([Figure(where, mean_over_pushes(chosen, weights))], note)


def _model(study: Study, grid: RepeatedGrid) -> list[LogDensities]:
    """The VHGP's densities of every push: at its repetitions, then at the values of the plot."""
    pushes = study.simulated.sets[study.simulated.reference]
    fit = Fit("vhgp", study.size_of(pushes), "none", 0)
    outcomes = [np.concatenate([cell.outcomes, shown_values(cell.outcomes)]) for cell in grid.seen]
    sizes = [len(rows) for rows in outcomes]
    call = (pushes, fit, np.repeat(grid.typical_inputs, sizes, axis=0), np.concatenate(outcomes))
    found = study.work.run("densities of repeated pushes", log_densities, [call])[0]
    parts = (np.split(logs, np.cumsum(sizes)[:-1]) for logs in (found.gaussian, found.exact))
    return [LogDensities(gaussian, exact) for gaussian, exact in zip(*parts, strict=True)]


def _counts_table(grid: RepeatedGrid, of: Shape, weights: Array, loss: Array) -> Table:
    """Numbers of pushes with several modes, and of pushes that are not Gaussian."""
    rows = []
    for k, name in enumerate(OUTPUT_NAMES):
        counts = (int(np.sum(p[:, k] <= LEVEL)) for p in (of.several, of.dip, of.normal))
        gain, lost = (mean_over_pushes(v[:, k : k + 1], weights) for v in (of.two - of.one, loss))
        rows.append((name, *counts, f"{LEVEL * len(of.dip):.0f}", Number(gain, "+.3f"), Number(lost)))
    head = (
        "outcome",
        "several modes, 5 % family-wise",
        "dip, single tests at 5 %",
        "Gaussian rejected, single tests at 5 %",
        "single rejections by chance",
        "two Gaussians over one (nats)",
        "lost by the VHGP's Gaussian (nats)",
    )
    caption = (
        f"Numbers of pushes with more than one mode, of {len(grid.seen)} simulated pushes of the grid on "
        f"{grid.surface}, about {_repetitions(grid)} repetitions each, first window. Family-wise: the probability of "
        "one or more false ones is at most 5 %. Two Gaussians: log density of held-out fifths of the repetitions, "
        f"minus that of one. Lost: by the VHGP to the push's own fit. {OF_BLOCKS}"
    )
    return Table(caption, head, tuple(rows))


def _picture(study: Study, grid: RepeatedGrid, of: Shape, of_model: Sequence[LogDensities]) -> Picture:
    order, places = np.argsort(of.dip, axis=0), (0, min(1, len(of.dip) - 1), len(of.dip) // 2)
    rows = [[_histogram(grid, of, of_model, int(order[place, k]), k) for k in range(3)] for place in places]
    return picture(
        study.out / "histograms.png",
        (10.0, 7.6),
        partial(paint_histograms, rows=rows),
        "Histograms of single repeated pushes with the VHGP's densities. Outcomes in the first 0.2 s, about "
        f"{_repetitions(grid)} repetitions on {grid.surface}, simulated. Rows: largest, second largest and median dip "
        f"of each output. Lines: the VHGP ({study.plan.size} windows of other pushes), moment-matched and exact. Each "
        f"panel has its own scales and shows at least {WIDTHS:g} of the VHGP's sd to both sides of its mean. p: of "
        "the dip alone, without correction.",
    )


def _histogram(grid: RepeatedGrid, of: Shape, of_model: Sequence[LogDensities], push: int, k: int) -> Histogram:
    cell, logs = grid.seen[push], of_model[push]
    r = len(cell.outcomes)
    title = f"{SYMBOLS[k]}: {place_text((cell.fraction, cell.angle))}, p = {of.dip[push, k]:.2g}"
    values = shown_values(cell.outcomes)[:, k]
    return Histogram(title, k, cell.outcomes[:, k], values, logs.gaussian[r:, k], logs.exact[r:, k])


def _repetitions(grid: RepeatedGrid) -> int:
    """The median number of repetitions of a push of the grid."""
    return int(np.median([len(cell.outcomes) for cell in grid.seen]))
