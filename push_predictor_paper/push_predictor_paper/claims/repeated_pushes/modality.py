# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Do repeated pushes have more than one mode, and how well does a Gaussian describe them?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from push_predictor.reporting.canvas import SYMBOLS, Picture, draw
from push_predictor.types import Array
from push_predictor_paper.claims.repeated_pushes.modality_rules import (
    FAR,
    GOOD,
    LEVEL,
    POOR,
    POWER,
    good_gaussian,
    mean_over_pushes,
    model_loss,
    not_gaussian,
    some_modes,
)
from push_predictor_paper.claims.repeated_pushes.modality_tables import (
    LISTED,
    SEPARATIONS,
    WHEN,
    Powers,
    counts_table,
    listed_table,
    place_of,
    power_table,
    repetitions_of,
)
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.figures.histograms import WIDTHS, Histogram, paint_histograms, shown_values
from push_predictor_paper.fits.fit import Fit
from push_predictor_paper.section import Finding, Section
from push_predictor_paper.statistics.densities import LogDensities, Shape, found_at, log_densities, shape
from push_predictor_paper.statistics.grid_maps import BLOCK, block_weights, in_degrees
from push_predictor_paper.study import Study


def section(study: Study) -> Section:
    """Tests of unimodality, their power, and the loss of Gaussian densities."""
    grid = study.reference_grid
    if not grid.seen:
        note = "No push of the grid has enough repetitions to test for modes."
        return Section("modality", TITLE, (Finding(CLAIM_MODES, "not decided", note),), notes=(note,))
    at, weights = _shapes(study, grid.seen), block_weights(grid.seen)
    powers = {s: found_at(s, repetitions_of(grid), 3 * len(grid.seen), LEVEL) for s in SEPARATIONS}
    of_model = _model(study, grid)
    loss = model_loss(grid.seen, at["window"], of_model)
    return Section(
        key="modality",
        title=TITLE,
        findings=(
            _modes_finding(at, powers[FAR][0]),
            _gaussian_finding(at["window"], weights),
            _good_finding(at["window"], loss, weights, study),
        ),
        tables=(counts_table(grid, at, weights), power_table(grid, powers), listed_table(grid, at["window"], loss)),
        pictures=(_picture(study, grid, at["window"], of_model),),
        notes=NOTES if not study.measured else (*NOTES, "The measured sets have no grid of repeated pushes."),
        data=_json(grid, at, powers, loss),
    )


TITLE = "Single pushes: histograms and modes"
CLAIM_MODES = "Some repeated pushes have outcomes with more than one mode"
CLAIM_GAUSSIAN = "The outcomes of some repeated pushes are not Gaussian"
CLAIM_GOOD = "The VHGP's Gaussian approximates even pushes with several modes well"
NOTES = (
    "Hartigan's dip test measures the distance of the outcomes' distribution from the nearest unimodal one. Its p "
    "value is against the uniform, the unimodal distribution hardest to distinguish from two modes. It therefore "
    "rejects bell-shaped outcomes far less often than its level. Holm's correction covers all pushes and outputs of "
    "one time.",
    "The noise of simulated pushes comes from friction and pressure that vary smoothly over table and slider, and from "
    "Gaussian sensor noise. Whether that splits a push into two outcomes is a property of the simulator and proves "
    "nothing about real pushes. The paper shows its modes without a test.",
    f"Intervals resample blocks of neighbouring pushes ({BLOCK[0]:g} of the side × {in_degrees(BLOCK[1])}), because "
    "they share the error of a model.",
    "Each output is tested alone. The three together may have modes that none of them shows.",
)


def _shapes(study: Study, cells: Sequence[Repetitions]) -> dict[str, Shape]:
    """Shapes of the outcomes at the end of the first window and at the end of the push."""
    sizes = np.array([len(cell.outcomes) for cell in cells])
    outcomes = ([cell.outcomes for cell in cells], [cell.paths[:, -1] for cell in cells])
    shapes = study.work.run("modes of repeated pushes", shape, [(np.concatenate(rows), sizes) for rows in outcomes])
    return dict(zip(WHEN, shapes, strict=True))


def _modes_finding(at: Mapping[str, Shape], power_far: float) -> Finding:
    counts = {when: int((of.several <= LEVEL).any(axis=1).sum()) for when, of in at.items()}
    found = "; ".join(f"{WHEN[when]}, {count} of {len(at[when].dip)}" for when, count in counts.items())
    raw = "; ".join(f"{WHEN[when]}, {np.sum(of.dip <= LEVEL)} of {of.dip.size}" for when, of in at.items())
    return Finding(
        CLAIM_MODES,
        some_modes(counts["window"], counts["end"], power_far),
        f"Pushes with more than one mode in some output, 5 % family-wise: {found}. Single tests at 5 % without "
        f"correction reject: {raw}; at most {LEVEL * at['window'].dip.size:.0f} of each are expected by chance. Two "
        f"equal modes {FAR:.0f} of their sd apart would be found in {power_far:.0%} of cases, with correction. Rule: "
        "holds if a push has several modes in the first window, in part if only at the end; does not hold if none "
        f"has, although modes that far apart are found in {POWER:.0%} of cases.",
        number=f"{counts['window']} of {len(at['window'].dip)} pushes",
    )


def _gaussian_finding(of: Shape, weights: Array) -> Finding:
    certain = int(np.sum(of.normal.min(axis=1) <= LEVEL / of.normal.size))
    share = mean_over_pushes((of.normal <= LEVEL).astype(np.float64), weights)
    gain = mean_over_pushes(of.two - of.one, weights)
    return Finding(
        CLAIM_GAUSSIAN,
        not_gaussian(certain, share),
        f"{certain} of {len(of.normal)} pushes have an output that is not Gaussian in the first window (Shapiro and "
        f"Wilk, 5 % family-wise, Bonferroni). {share.text('.1%')} of the single tests reject at 5 %. Two Gaussians "
        f"instead of one change the log density of held-out repetitions by {gain.text('+.3f')} nats an outcome. Rule: "
        "holds if a push is not Gaussian; in part if none, but the share's interval lies above 5 %; does not hold if "
        "none and the interval ends below 10 %.",
        number=f"{certain} of {len(of.normal)} pushes",
    )


def _good_finding(at: Shape, loss: Array, weights: Array, study: Study) -> Finding:
    several = at.several <= LEVEL
    pushes = several.any(axis=1)
    largest = np.isin(np.arange(len(loss)), np.argsort(at.dip.min(axis=1))[:LISTED])
    chosen = np.where(largest[:, None], loss, np.nan)
    where = f"no push has several modes; over the {largest.sum()} with the largest dips"
    if pushes.any():
        chosen = np.where(several, loss, np.nan)
        where = f"where there are several modes ({pushes.sum()} pushes)"
    given = mean_over_pushes(chosen, weights)
    return Finding(
        CLAIM_GOOD,
        good_gaussian(given) if pushes.any() else "not decided",
        f"Loss of the VHGP's Gaussian against the one or two Gaussians fitted to the push itself: {where} "
        f"{given.text()} nats an outcome and output; over all {len(loss)} pushes "
        f"{mean_over_pushes(loss, weights).text()}. VHGP of {study.plan.size} windows of other pushes, the first of "
        f"{study.plan.seeds} draws; first window. Rule, where there are several modes: holds if the interval ends "
        f"below {GOOD}, in part if below {POOR} (the cost of an sd twice too wide), does not hold if it lies above.",
        number=f"loss {given.text()} nats",
    )


def _model(study: Study, grid: RepeatedGrid) -> list[LogDensities]:
    """The VHGP's densities of every push: at its repetitions, then at the values of the plot."""
    pushes = study.simulated.sets[study.simulated.reference]
    fit = Fit("vhgp", min(study.plan.size, len(pushes.table)), "none", 0)
    outcomes = [np.concatenate([cell.outcomes, shown_values(cell.outcomes)]) for cell in grid.seen]
    sizes = [len(rows) for rows in outcomes]
    call = (pushes, fit, np.repeat(grid.typical_inputs, sizes, axis=0), np.concatenate(outcomes))
    found = study.work.run("densities of repeated pushes", log_densities, [call])[0]
    parts = (np.split(logs, np.cumsum(sizes)[:-1]) for logs in (found.gaussian, found.exact))
    return [LogDensities(gaussian, exact) for gaussian, exact in zip(*parts, strict=True)]


def _picture(study: Study, grid: RepeatedGrid, of: Shape, of_model: Sequence[LogDensities]) -> Picture:
    order, places = np.argsort(of.dip, axis=0), (0, min(1, len(of.dip) - 1), len(of.dip) // 2)
    rows = [[_histogram(grid, of, of_model, int(order[place, k]), k) for k in range(3)] for place in places]
    path = draw(study.out / "histograms.png", (10.0, 7.6), lambda figure: paint_histograms(figure, rows))
    return Picture(
        path,
        "Histograms of single repeated pushes with the VHGP's densities",
        f"Outcomes of single simulated pushes on {grid.surface} in the first 0.2 s, about {repetitions_of(grid)} "
        "repetitions, normalised. Rows: largest, second largest and median dip of each output. Lines: the VHGP "
        f"({study.plan.size} windows of other pushes, first of {study.plan.seeds} draws), moment-matched and exact. "
        f"Each panel has its own scales and shows at least {WIDTHS:g} of the VHGP's sd to both sides of its mean. c: "
        "contact as a fraction of the side; angle from its normal. p: of the dip alone, without correction.",
    )


def _histogram(grid: RepeatedGrid, of: Shape, of_model: Sequence[LogDensities], push: int, k: int) -> Histogram:
    cell, logs = grid.seen[push], of_model[push]
    r = len(cell.outcomes)
    title = f"{SYMBOLS[k]}: {place_of(cell)}, p = {of.dip[push, k]:.2g}"
    values = shown_values(cell.outcomes)[:, k]
    return Histogram(title, k, cell.outcomes[:, k], values, logs.gaussian[r:, k], logs.exact[r:, k])


def _json(grid: RepeatedGrid, at: Mapping[str, Shape], powers: Powers, loss: Array) -> dict[str, Any]:
    return {
        "pushes": [{"fraction": c.fraction, "angle": c.angle, "repetitions": len(c.outcomes)} for c in grid.seen],
        "tests": {
            when: {
                "dip_p": of.dip.tolist(),
                "dip_family_wise_p": of.several.tolist(),
                "gaussian_p": of.normal.tolist(),
                "two_gaussians_over_one": (of.two - of.one).tolist(),
            }
            for when, of in at.items()
        },
        "power": [{"separation": s, "family_wise": both, "single": one} for s, (both, one) in powers.items()],
        "given_away": loss.tolist(),
    }
