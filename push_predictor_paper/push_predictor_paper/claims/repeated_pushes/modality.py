"""Which repeated pushes have more than one mode, and what a Gaussian makes of them."""

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
    """Tests of unimodality, what they could have found, and what Gaussians lose where they are wrong."""
    grid = study.reference_grid
    if not grid.seen:
        note = "No push of the grid was seen often enough to look for modes."
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
        notes=NOTES if not study.measured else (*NOTES, "The measured sets hold no grid of repeated pushes."),
        data=_json(grid, at, powers, loss),
    )


TITLE = "Single pushes: histograms and modes"
CLAIM_MODES = "Some pushes, repeated, have outcomes with more than one mode"
CLAIM_GAUSSIAN = "The outcomes of some repeated pushes are not Gaussian"
CLAIM_GOOD = "The VHGP's Gaussian is a good approximation also of the pushes with several modes"
NOTES = (
    "Hartigan's dip test: how far the distribution of a push's outcomes is from the nearest with one mode. Its p value "
    "is against the uniform, the unimodal law hardest to tell from two modes: of bell-shaped outcomes it rejects far "
    "fewer than its level says. Holm's correction over all pushes and outputs of one time.",
    "Where simulated pushes scatter, they do so by friction and pressure that vary smoothly over table and slider, and "
    "by Gaussian sensor noise. Whether that splits a push into two outcomes is a property of our simulator and proves "
    "nothing about the robot's pushes. The paper shows its modes by eye, without a test.",
    f"Intervals draw blocks of neighbouring pushes ({BLOCK[0]:g} of the side × {in_degrees(BLOCK[1])}): they share the "
    "error of a model.",
    "Each output is tested by itself: the three together may have modes that none of them shows.",
)


def _shapes(study: Study, cells: Sequence[Repetitions]) -> dict[str, Shape]:
    """At the end of the first window, and at the end of the push."""
    sizes = np.array([len(cell.outcomes) for cell in cells])
    outcomes = ([cell.outcomes for cell in cells], [cell.paths[:, -1] for cell in cells])
    shapes = study.work.run("modes of repeated pushes", shape, [(np.concatenate(rows), sizes) for rows in outcomes])
    return dict(zip(WHEN, shapes, strict=True))


def _modes_finding(at: Mapping[str, Shape], power_far: float) -> Finding:
    counts = {when: int((of.several <= LEVEL).any(axis=1).sum()) for when, of in at.items()}
    told = "; ".join(f"{WHEN[when]}, {count} of {len(at[when].dip)}" for when, count in counts.items())
    raw = "; ".join(f"{WHEN[when]}, {np.sum(of.dip <= LEVEL)} of {of.dip.size}" for when, of in at.items())
    return Finding(
        CLAIM_MODES,
        some_modes(counts["window"], counts["end"], power_far),
        f"Pushes with more than one mode in some output, 5 % family-wise: {told}. Without correction single tests at "
        f"5 % reject: {raw}; by chance at most {LEVEL * at['window'].dip.size:.0f} of each. Two equal modes {FAR:.0f} "
        f"of their sd apart would be found in {power_far:.0%} of cases, with correction. Asked: a push in the first "
        f"window (in part: at the end only); does not hold: none, though modes that far apart are found in {POWER:.0%} "
        "of cases.",
    )


def _gaussian_finding(of: Shape, weights: Array) -> Finding:
    certain = int(np.sum(of.normal.min(axis=1) <= LEVEL / of.normal.size))
    share = mean_over_pushes((of.normal <= LEVEL).astype(np.float64), weights)
    gain = mean_over_pushes(of.two - of.one, weights)
    return Finding(
        CLAIM_GAUSSIAN,
        not_gaussian(certain, share),
        f"Shapiro and Wilk's test, first window: {certain} of {len(of.normal)} pushes have an output that is not "
        f"Gaussian, 5 % family-wise (Bonferroni); {share.text('.1%')} of the single tests reject at 5 %, as 5 % do of "
        f"Gaussians. What it matters: two Gaussians instead of one change the log density of held-out repetitions by "
        f"{gain.text('+.3f')} nats an outcome. Asked: a push (in part: none, but the share's interval above 5 %; does "
        "not hold: none and the interval below 10 %).",
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
        f"To the Gaussian, or the two, fitted to the push itself, the VHGP's gives away: {where} {given.text()} nats "
        f"an outcome and output, over all {len(loss)} {mean_over_pushes(loss, weights).text()}. Asked where there are "
        "several "
        f"modes: an interval below {GOOD} (in part: below {POOR}, the cost of an sd twice too wide; does not hold: "
        f"above it). "
        f"VHGP of {study.plan.size} windows of other pushes, the first of {study.plan.seeds} draws of these; first "
        "window.",
    )


def _model(study: Study, grid: RepeatedGrid) -> list[LogDensities]:
    """The VHGP's densities of every push: of its repetitions, then of the values that are drawn."""
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
        f"Simulated: outcomes of single pushes on {grid.surface} in the first 0.2 s, about {repetitions_of(grid)} "
        "repetitions, normalised. First and second row: largest and second largest dip of each output; third: the "
        f"median one. Lines: the VHGP ({study.plan.size} windows of other pushes, first of {study.plan.seeds} draws), "
        "moment-matched and exact (where it was asked). "
        f"Every panel has scales of its own and shows at least {WIDTHS:g} of the VHGP's sd to both sides of its mean. "
        "c: "
        "contact as a fraction of the side, angle from its normal. p: of the dip alone, without correction.",
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
