# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""KL divergence of models from repeated pushes, by the correct formula and by the one the paper prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from push_predictor.reporting.canvas import Picture, draw
from push_predictor_paper.claims.divergence.models import Found, Training, all_divergences, slow_windows
from push_predictor_paper.claims.divergence.rules import (
    STATISTICS,
    TOO_NARROW,
    TOO_WIDE,
    Divergences,
    by_seed,
    estimate,
    good,
    lower,
)
from push_predictor_paper.claims.divergence.tables import main_table, training_table
from push_predictor_paper.data.repetitions import RepeatedGrid
from push_predictor_paper.figures.divergence import NAMES, paint_divergence
from push_predictor_paper.fits.fit import KINDS
from push_predictor_paper.section import Finding, Section
from push_predictor_paper.statistics.divergence import expected_kl, gaussian_kl
from push_predictor_paper.statistics.grid_maps import BLOCK, block_weights, in_degrees, mean_of, median_of
from push_predictor_paper.study import Study


def section(study: Study) -> Section:
    """The paper's table, the effect of the training speeds, and maps of the divergence."""
    grid = study.reference_grid
    if not grid.seen:
        note = "No push of the grid has enough repetitions for a mean and a standard deviation."
        return Section("divergence", TITLE, (Finding(CLAIM_MEAN, "not decided", note),), notes=(note,))
    found = all_divergences(study, grid)
    main = found[0][1]
    floor = float(np.mean([3.0 * expected_kl(len(cell.outcomes)) for cell in grid.seen]))
    findings = (
        _lower("mean", CLAIM_MEAN, main),
        _lower("median", CLAIM_MEDIAN, main),
        _good(main["vhgp"], len(grid.seen)),
    )
    tables = (main_table(study, found[0][0], main, floor), training_table(study, found))
    return Section(
        key="divergence",
        title=TITLE,
        findings=findings,
        tables=tables,
        pictures=(_picture(study, grid, main, floor),),
        notes=(*NOTES, _floor_note(grid, floor), *_speed_note(found), *_lacking(study, found)),
        data={"pushes": len(grid.seen), "floor": floor, "models": [_json(t, d) for t, d in found]},
    )


TITLE = "KL divergence between repeated pushes and models"
CLAIM_MEAN = "The VHGP is closer to the distributions of repeated pushes than the GP, in mean KL"
CLAIM_MEDIAN = "The VHGP is closer to the distributions of repeated pushes than the GP, in median KL"
NOTES = (
    "KL(repetitions || model). As in the paper, both are taken as Gaussian with independent outputs. The model's sd is "
    "that of an outcome, its own uncertainty included. KL does not depend on the units of the outputs.",
    "The formula printed in the paper has log(sd2/sd1) in place of log(sd2^2/sd1^2). It is not a divergence: it is "
    "negative, down to −0.077 per output, for a model that is right but 1.4 times as wide. The paper does not state "
    "which formula its figures come from.",
    "The paper's figures are of the measured square: repetitions on the robot, models learned from the MIT set. "
    "Ours are of pushes on the simulator's plywood, over their first 0.2 s. How its noise grows with speed is an "
    "assumption.",
    f"Neighbouring pushes of the grid share the error of a model. Intervals therefore resample blocks of pushes "
    f"({BLOCK[0]:g} of the side × {in_degrees(BLOCK[1])}). The range over seeds shows the effect of other training "
    "windows.",
)


def _lower(name: str, claim: str, of: Mapping[str, Divergences]) -> Finding:
    gp, vhgp, statistic, weights = of["gp"].correct, of["vhgp"].correct, STATISTICS[name], of["gp"].weights
    difference = estimate(vhgp, statistic, weights, gp)
    below = int(np.sum(by_seed(vhgp, statistic) < by_seed(gp, statistic)))
    printed = estimate(of["vhgp"].printed, statistic, weights, of["gp"].printed)
    return Finding(
        claim,
        lower(difference, below, len(gp)),
        f"{name.capitalize()} KL of the VHGP {estimate(vhgp, statistic, weights).text()}, of the GP "
        f"{estimate(gp, statistic, weights).text()}. VHGP minus GP: {difference.text()}, paired over {gp.shape[1]} "
        f"pushes of the grid, in blocks of neighbours; lower in {below} of {len(gp)} seeds of training windows. "
        f"Difference by the formula as printed: {printed.text()}. Rule: holds if the interval of the difference and "
        "every seed lie below 0, in part if only the interval does, does not hold if the interval lies above 0.",
        number=f"VHGP minus GP: {difference.text()}",
    )


def _good(vhgp: Divergences, pushes: int) -> Finding:
    median, mean = (estimate(vhgp.correct, s, vhgp.weights) for s in (median_of, mean_of))
    return Finding(
        "The VHGP predicts the distribution of a push reasonably well",
        good(median),
        f"Median KL of the VHGP {median.text()}, mean {mean.text()}, {pushes} pushes (paper: median 5.34). A model "
        f"with exact means has {TOO_WIDE} if its sds are twice too wide, {TOO_NARROW} if they are half as wide. "
        f"Rule: holds if the median's interval lies below {TOO_WIDE}, in part if below {TOO_NARROW}, does not hold "
        "if above it.",
        number=f"median {median.text()}",
    )


def _picture(study: Study, grid: RepeatedGrid, of: Mapping[str, Divergences], floor: float) -> Picture:
    kl = {kind: of[kind].correct.mean(axis=0) for kind in KINDS}
    path = draw(study.out / "divergence.png", (10.5, 3.9), lambda figure: paint_divergence(figure, grid, kl, floor))
    return Picture(
        path,
        "Maps of the KL divergence over contact and angle for GP and VHGP, and its distribution over pushes",
        f"KL of {len(grid.seen)} simulated pushes on {grid.surface}, mean of {study.plan.seeds} seeds. Left, middle: "
        "by contact and angle, one log scale; grey: too few repetitions. Right: cumulative share of the pushes, "
        "dots at the median; dotted: expected value of a perfect model.",
    )


def _floor_note(grid: RepeatedGrid, floor: float) -> str:
    halves = []
    for cell in grid.seen:
        one, two = cell.outcomes[::2], cell.outcomes[1::2]
        moments = (one.mean(axis=0), one.std(axis=0, ddof=1), two.mean(axis=0), two.std(axis=0, ddof=1))
        halves.append(float(gaussian_kl(*moments).sum()))
    measured = estimate(np.array([halves]), mean_of, block_weights(grid.seen)).text(".3f")
    expected = np.mean([3.0 * expected_kl((n + 1) // 2, n // 2) for n in (len(cell.outcomes) for cell in grid.seen)])
    return (
        f"The floor: a perfect model has an expected mean KL of {floor:.3f}, by theory for Gaussians. Check on the "
        f"repetitions: one half of them from the other has {measured}; theory gives {expected:.3f} for halves. A "
        "larger value means tails heavier than Gaussian, and a proportionally higher floor."
    )


def _speed_note(found: Sequence[Found]) -> tuple[str, ...]:
    if len(found) < 3:
        return ()
    (_, every), (alone, slow) = found[1:]
    changes = "; ".join(f"{NAMES[k]} {_change(slow[k], every[k])}" for k in KINDS)
    return (
        f"Mean KL of models of {alone.n} windows of {alone.name} minus that of as many windows of all speeds: "
        f"{changes}. The difference is not the noise level alone. Other speeds also move the training inputs closer to "
        "the pushes of the grid, which acts mainly on the means; one noise level for all speeds acts on the sds.",
    )


def _change(slow: Divergences, every: Divergences) -> str:
    total, means, sds = (
        estimate(getattr(slow, part), mean_of, slow.weights, getattr(every, part)).text("+.2f")
        for part in ("correct", "of_mean", "of_sd")
    )
    return f"{total}, of wrong means {means}, of wrong sds {sds}"


def _lacking(study: Study, found: Sequence[object]) -> tuple[str, ...]:
    few = (
        ""
        if len(found) > 1
        else f"Only {len(slow_windows(study))} windows are at the grid's speed: too few to train on them alone."
    )
    measured = (
        "" if not study.measured else "The measured sets have no grid of repeated pushes, so there is no KL of them."
    )
    return tuple(note for note in (few, measured) if note)


def _json(training: Training, of: Mapping[str, Divergences]) -> dict[str, Any]:
    kinds = {
        kind: {
            f"{name}_{formula}": estimate(getattr(d, formula), statistic, d.weights).json()
            for name, statistic in STATISTICS.items()
            for formula in ("correct", "printed", "of_mean", "of_sd")
        }
        for kind, d in of.items()
    }
    return {"learnt_from": training.name, "windows": training.n, "kinds": kinds}
