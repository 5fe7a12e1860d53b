"""Which repeated pushes have more than one mode, and what a Gaussian makes of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from push_predictor.evaluation.figures.canvas import SYMBOLS, Picture, draw
from push_predictor.paper.densities import LogDensities, Shape, found_at, log_densities, shape
from push_predictor.paper.estimate import Estimate, of_draws
from push_predictor.paper.figures.histograms import Histogram, paint_histograms, shown_values
from push_predictor.paper.fits import Fit
from push_predictor.paper.repetitions import RepeatedGrid, Repetitions
from push_predictor.paper.section import Finding, Section, Table, Verdict
from push_predictor.paper.study import Study
from push_predictor.types import Array

LEVEL = 0.05
FAR, POWER = 6.0, 0.8  # two equal modes so many of their sd apart should be found so often
SEPARATIONS = (3.0, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0, 7.0, 8.0, 10.0)
LISTED = 10
GOOD, POOR = 0.16, 0.32  # nats an outcome; 0.32: what an sd twice as wide as it should be costs
OUTPUT_NAMES = ("dx", "dy", "dθ")
WHEN = {"window": "first 0.2 s", "end": "end of the 1 cm push"}

Powers = Mapping[float, tuple[float, float]]  # by separation: found family-wise, found by a single test


def section(study: Study) -> Section:
    """Tests of unimodality, what they could have found, and what Gaussians lose where they are wrong."""
    grid = study.reference_grid
    if not grid.seen:
        note = "No push of the grid was seen often enough to look for modes."
        return Section("modality", TITLE, (Finding(CLAIM_MODES, "not decided", note),), notes=(note,))
    at = _shapes(study, grid.seen)
    powers = {s: found_at(s, _repetitions(grid), 3 * len(grid.seen), LEVEL) for s in SEPARATIONS}
    of_model = _model(study, grid)
    loss = model_loss(grid.seen, at["window"], of_model)
    return Section(
        key="modality",
        title=TITLE,
        findings=(_modes_finding(at, powers[FAR][0]), _gaussian_finding(at), _good_finding(at["window"], loss, study)),
        tables=(_counts_table(grid, at), _power_table(grid, powers), _listed_table(grid, at["window"], loss)),
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
    "Each output is tested by itself: the three together may have modes that none of them shows.",
)


def _shapes(study: Study, cells: Sequence[Repetitions]) -> dict[str, Shape]:
    """At the end of the first window, and at the end of the push."""
    sizes = np.array([len(cell.outcomes) for cell in cells])
    outcomes = ([cell.outcomes for cell in cells], [cell.paths[:, -1] for cell in cells])
    shapes = study.work.run("modes of repeated pushes", shape, [(np.concatenate(rows), sizes) for rows in outcomes])
    return dict(zip(WHEN, shapes, strict=True))


def model_loss(cells: Sequence[Repetitions], at: Shape, of_model: Sequence[LogDensities]) -> Array:
    """Mean log density (p, 3) that the model's Gaussian gives away to the better description by the push itself."""
    model = [logs.gaussian[: len(c.outcomes)].mean(axis=0) for c, logs in zip(cells, of_model, strict=True)]
    return np.asarray(at.own - np.array(model))


def mean_over_pushes(values: Array) -> Estimate:
    """Mean of those of values (p, k) that are not NaN, by drawing pushes anew."""
    rows = np.random.default_rng(0).integers(0, len(values), (1000, len(values)))
    sums, counts = np.nansum(values, axis=1), np.sum(np.isfinite(values), axis=1)
    return of_draws(float(sums.sum() / counts.sum()), sums[rows].sum(axis=1) / counts[rows].sum(axis=1))


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


def some_modes(in_window: int, at_end: int, power_far: float) -> Verdict:
    """What the number of pushes with several modes says, and how surely the test would find them."""
    if in_window > 0:
        return "holds"
    if at_end > 0:
        return "holds in part"
    return "does not hold" if power_far >= POWER else "not decided"


def _gaussian_finding(at: Mapping[str, Shape]) -> Finding:
    of = at["window"]
    certain = int(np.sum(of.normal.min(axis=1) <= LEVEL / of.normal.size))
    share = mean_over_pushes((of.normal <= LEVEL).astype(np.float64))
    gain = mean_over_pushes(of.two - of.one)
    return Finding(
        CLAIM_GAUSSIAN,
        not_gaussian(certain, share),
        f"Shapiro and Wilk's test, first window: {certain} of {len(of.normal)} pushes have an output that is not "
        f"Gaussian, 5 % family-wise (Bonferroni); {share.text('.1%')} of the single tests reject at 5 %, as 5 % do of "
        f"Gaussians. What it matters: two Gaussians instead of one change the log density of held-out repetitions by "
        f"{gain.text('+.3f')} nats an outcome. Asked: a push (in part: none, but the share's interval above 5 %; does "
        "not hold: none and the interval below 10 %).",
    )


def not_gaussian(certain: int, share: Estimate) -> Verdict:
    """What the number of pushes that are surely not Gaussian says, and the share of single tests that reject."""
    if certain > 0:
        return "holds"
    if share.low > LEVEL:
        return "holds in part"
    return "does not hold" if share.high < 2.0 * LEVEL else "not decided"


def _good_finding(at: Shape, loss: Array, study: Study) -> Finding:
    several = at.several <= LEVEL
    pushes = several.any(axis=1)
    chosen = loss[np.argsort(at.dip.min(axis=1))[:LISTED]]
    where = f"no push has several modes; over the {len(chosen)} with the largest dips"
    if pushes.any():
        chosen = np.where(several, loss, np.nan)[pushes]
        where = f"where there are several modes ({pushes.sum()} pushes)"
    given = mean_over_pushes(chosen)
    return Finding(
        CLAIM_GOOD,
        good_gaussian(given) if pushes.any() else "not decided",
        f"To the Gaussian, or the two, fitted to the push itself, the VHGP's gives away: {where} {given.text()} nats "
        f"an outcome and output, over all {len(loss)} {mean_over_pushes(loss).text()}. Asked where there are several "
        f"modes: an interval below {GOOD} (in part: below {POOR}, the cost of an sd twice too wide; does not hold: "
        f"above it). "
        f"VHGP of {study.plan.size} windows of other pushes, seed 0; first window.",
    )


def good_gaussian(given_away: Estimate) -> Verdict:
    """What the loss against a push's own description says."""
    if given_away.high < GOOD:
        return "holds"
    if given_away.high < POOR:
        return "holds in part"
    return "does not hold" if given_away.low > POOR else "not decided"


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


def _counts_table(grid: RepeatedGrid, at: Mapping[str, Shape]) -> Table:
    rows = []
    for when, of in at.items():
        for k, name in enumerate(OUTPUT_NAMES):
            counts = (np.sum(p <= LEVEL) for p in (of.several[:, k], of.dip[:, k], of.normal[:, k]))
            gain = mean_over_pushes((of.two - of.one)[:, k : k + 1]).cell("+.3f")
            rows.append((f"{WHEN[when]}: {name}", *map(str, counts), f"{LEVEL * len(of.dip):.0f}", gain))
    head = (
        "outcome",
        "several modes, 5 % family-wise",
        "dip, single tests at 5 %",
        "Gaussian rejected, single tests at 5 %",
    )
    caption = (
        f"Simulated: how many of {len(grid.seen)} pushes of the grid on {grid.surface} have more than one mode, about "
        f"{_repetitions(grid)} repetitions each. Of the family-wise ones, one or more would be false with 5 % "
        "probability at most. Last: log density of held-out fifths of the repetitions, two Gaussians less one; "
        "beneath, 95 % interval, pushes drawn anew; single outliers weigh heavily in it."
    )
    return Table(caption, (*head, "single rejections by chance", "two Gaussians over one (nats)"), tuple(rows))


def _power_table(grid: RepeatedGrid, powers: Powers) -> Table:
    rows = tuple((f"{s:.1f}", f"{corrected:.0%}", f"{single:.0%}") for s, (corrected, single) in powers.items())
    enough = [s for s, (corrected, _) in powers.items() if corrected >= POWER]
    least = f"from {enough[0]:.1f} sd on" if enough else f"only beyond {SEPARATIONS[-1]:.0f} sd"
    caption = (
        f"What the test would find at {_repetitions(grid)} repetitions: two equal Gaussian modes, their distance in "
        f"units of the sd of each (below 2 their sum has one mode), by 1000 draws, ±3 % at the most. {POWER:.0%} are "
        f"found {least}; nearer modes may have been missed."
    )
    return Table(caption, ("distance of the modes (sd)", "found, 5 % family-wise", "found by one test at 5 %"), rows)


def _listed_table(grid: RepeatedGrid, of: Shape, loss: Array) -> Table:
    rows = []
    for place in np.argsort(of.dip, axis=None)[: max(LISTED, int(np.sum(of.several <= LEVEL)))]:
        push, k = divmod(int(place), 3)
        nats = (f"{v:+.2f}".replace("-", "−") for v in (of.two[push, k] - of.one[push, k], loss[push, k]))
        tests = (f"{p[push, k]:.2g}" for p in (of.dip, of.several, of.normal))
        rows.append(
            (f"{_where(grid.seen[push])}: {OUTPUT_NAMES[k]}", str(len(grid.seen[push].outcomes)), *tests, *nats)
        )
    head = ("push", "repetitions", "p of the dip", "p family-wise", "p of a Gaussian", "two Gaussians over one (nats)")
    caption = (
        "Simulated: the outcomes of the first window with the largest dips, and all with several modes. Last: what the "
        "VHGP's Gaussian gives away to the push's own. Single pushes, no interval."
    )
    return Table(caption, (*head, "given away by the VHGP (nats)"), tuple(rows))


def _repetitions(grid: RepeatedGrid) -> int:
    return int(np.median([len(cell.outcomes) for cell in grid.seen]))


def _where(cell: Repetitions) -> str:
    return f"contact {cell.fraction:.2f}, angle {cell.angle:+.1f}".replace("-", "−")


def _picture(study: Study, grid: RepeatedGrid, of: Shape, of_model: Sequence[LogDensities]) -> Picture:
    order, places = np.argsort(of.dip, axis=0), (0, min(1, len(of.dip) - 1), len(of.dip) // 2)
    rows = [[_histogram(grid, of, of_model, int(order[place, k]), k) for k in range(3)] for place in places]
    path = draw(study.out / "histograms.png", (10.0, 7.6), lambda figure: paint_histograms(figure, rows))
    return Picture(
        path,
        "Histograms of single repeated pushes with the VHGP's densities",
        f"Simulated: outcomes of single pushes on {grid.surface} in the first 0.2 s, about {_repetitions(grid)} "
        "repetitions, normalised. First and second row: largest and second largest dip of each output; third: the "
        f"median one. Lines: the VHGP ({study.plan.size} windows of other pushes, seed 0), moment-matched and exact. "
        "Every panel has scales of its own. p: of the dip alone, without correction.",
    )


def _histogram(grid: RepeatedGrid, of: Shape, of_model: Sequence[LogDensities], push: int, k: int) -> Histogram:
    cell, logs = grid.seen[push], of_model[push]
    r = len(cell.outcomes)
    title = f"{SYMBOLS[k]}: {_where(cell)} rad, p = {of.dip[push, k]:.2g}"
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
