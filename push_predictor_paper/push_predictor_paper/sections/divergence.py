# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""KL divergence of models from repeated pushes, by the correct formula and by the one the paper prints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.special import digamma

from push_predictor.evaluation.estimate import Estimate
from push_predictor.evaluation.report.maps import ColourScale
from push_predictor.reporting.canvas import Picture
from push_predictor.types import Array
from push_predictor_paper.data.repetitions import RepeatedGrid
from push_predictor_paper.fits.fit import KIND_NAMES, KINDS, Answer
from push_predictor_paper.fits.map_models import reference_maps
from push_predictor_paper.painters.maps import Map, paint_maps
from push_predictor_paper.section import Number, Section, Table, TooFewError, picture
from push_predictor_paper.statistics.grid_maps import OF_BLOCKS, Statistic, block_weights, by_blocks, mean_of, median_of
from push_predictor_paper.study import Study
from push_predictor_paper.verdict import Evidence, Figure

STATISTICS: dict[str, Statistic] = {"mean": mean_of, "median": median_of}
PAPER = {"gp": ("22.63", "5.74"), "vhgp": ("15.32", "5.34")}
NOTES = (
    "KL(repetitions || model). As in the paper, both are taken as Gaussian with independent outputs. The model's sd is "
    "that of an outcome, its own uncertainty included. KL does not depend on the units of the outputs.",
    "The formula printed in the paper has log(sd2/sd1) in place of log(sd2^2/sd1^2). It is not a divergence: it is "
    "negative, down to −0.077 per output, for a model that is right but 1.4 times as wide. The paper does not state "
    "which formula its figures come from.",
    "The paper's figures are of the measured square: repetitions on the robot, models learned from the MIT set. "
    "Ours are of pushes on the simulator's plywood, over their first 0.2 s. How its noise grows with speed is an "
    "assumption.",
    "A perfect model's expected KL is by theory for Gaussians; heavier tails give a proportionally higher one.",
)


@dataclass(frozen=True, eq=False)
class Divergences:
    """Of p pushes from models of s seeds, (s, p), three outputs together: nats.

    weights (d, p): draws of blocks of neighbouring pushes, which share the error of a model.
    """

    correct: Array
    printed: Array
    weights: Array


def section(study: Study) -> Section:
    """The paper's table, and maps of the divergence."""
    grid = study.reference_grid
    if not grid.seen:
        raise TooFewError("No push of the grid has enough repetitions for a mean and a standard deviation.")
    models = {kind: reference_maps(study, kind) for kind in KINDS}
    found = {kind: divergences(grid, [m.at_pushes for m in maps if m.at_pushes]) for kind, maps in models.items()}
    floor = float(np.mean([3.0 * expected_kl(len(cell.outcomes)) for cell in grid.seen]))
    median, mean = (estimate(found["vhgp"].correct, s, found["vhgp"].weights) for s in (median_of, mean_of))
    good = Evidence([Figure("", median)], f"Mean {mean.text()}, {len(grid.seen)} pushes.")
    return Section(
        {**{name: nearer(name, found) for name in STATISTICS}, "good": good},
        (_table(study, found, floor),),
        (_maps(study, grid, found),),
        NOTES,
    )


def divergences(grid: RepeatedGrid, answers: Sequence[Answer]) -> Divergences:
    """Divergences of the models' answers, one a seed, from the pushes of the grid."""
    mean, sd = (np.array([getattr(cell, what) for cell in grid.seen]) for what in ("mean", "sd"))
    model_mean, model_sd = (np.array([getattr(answer, what) for answer in answers]) for what in ("mean", "sd"))
    correct, printed = (kl(mean, sd, model_mean, model_sd).sum(axis=2) for kl in (gaussian_kl, printed_kl))
    return Divergences(correct, printed, block_weights(grid.seen))


def gaussian_kl(mean: Array, sd: Array, model_mean: Array, model_sd: Array) -> Array:
    """KL(N(mean, sd^2) || N(model_mean, model_sd^2)) elementwise, nats, 0 where they agree; shapes broadcast.

    mean and model_mean in one unit, which drops out; sd and model_sd > 0 in the same.
    """
    ratio = (sd / model_sd) ** 2
    return np.asarray(0.5 * (ratio - 1.0 - np.log(ratio)) + 0.5 * ((mean - model_mean) / model_sd) ** 2)


def printed_kl(mean: Array, sd: Array, model_mean: Array, model_sd: Array) -> Array:
    """The KL divergence as printed in Bauza and Rodriguez 2017, section VI, where the log term is half too small.

    It is not a divergence: for a correct model with 1.4 times the standard deviation it reaches its minimum of -0.077.
    """
    return gaussian_kl(mean, sd, model_mean, model_sd) - 0.5 * np.log(model_sd / sd)


def expected_kl(count: int) -> float:
    """Expected KL divergence from mean and sd (ddof 1) of `count` > 1 samples to the true Gaussian, a correct model."""
    freedom = 0.5 * (count - 1)
    return 0.5 * float(np.log(freedom) - digamma(freedom) + 1.0 / count)


def estimate(values: Array, statistic: Statistic, weights: Array, less: Array | None = None) -> Estimate:
    """Mean over seeds of a statistic of values (s, p), with interval from weights (d, p); minus that of `less`."""

    def over_seeds(of: Array, w: Array) -> Array:
        return np.asarray(np.mean([statistic(seed, w) for seed in of], axis=0))

    return by_blocks(lambda w: over_seeds(values, w) - (0.0 if less is None else over_seeds(less, w)), weights)


def by_seed(values: Array, statistic: Statistic) -> Array:
    """A statistic (s,) over the pushes of values (s, p)."""
    return np.array([statistic(seed, np.ones((1, len(seed))))[0] for seed in values])


def nearer(name: str, of: Mapping[str, Divergences]) -> Evidence:
    """Is the VHGP closer than the GP, in this statistic?"""
    gp, vhgp, statistic, weights = of["gp"].correct, of["vhgp"].correct, STATISTICS[name], of["gp"].weights
    difference = estimate(vhgp, statistic, weights, gp)
    below = int(np.sum(by_seed(vhgp, statistic) < by_seed(gp, statistic)))
    printed = estimate(of["vhgp"].printed, statistic, weights, of["gp"].printed)
    note = (
        f"{gp.shape[1]} pushes of the grid; lower in {below} of {len(gp)} seeds of training windows. By the formula as "
        f"printed: {printed.text()}."
    )
    return Evidence([Figure("", difference)], note)


def _table(study: Study, of: Mapping[str, Divergences], floor: float) -> Table:
    """The paper's table, its figures next to ours."""
    rows: list[tuple[object, ...]] = []
    for kind, d in of.items():
        numbers = [estimate(values, s, d.weights) for values in (d.correct, d.printed) for s in STATISTICS.values()]
        rows.append((KIND_NAMES[kind], *map(Number, numbers), *PAPER.get(kind, ("–", "–"))))
    ours = ("mean KL", "median KL", "mean, formula as printed", "median, formula as printed")
    head = ("model", *ours, "paper: mean (other data)", "paper: median (other data)")
    caption = (
        f"KL (nats, three outputs) of models from {len(study.reference_grid.seen)} simulated pushes of the grid, "
        f"{study.plan.repetitions} repetitions each. Models of windows of all speeds of "
        f"{study.simulated.reference_name}, none of the grid; mean of {study.plan.seeds} seeds. {OF_BLOCKS} "
        "A perfect model: the expected KL with so many repetitions."
    )
    return Table(caption, head, (*rows, ("a perfect model", f"{floor:.3f}", *("–",) * 5)))


def _maps(study: Study, grid: RepeatedGrid, of: Mapping[str, Divergences]) -> Picture:
    kl = {kind: of[kind].correct.mean(axis=0) for kind in ("gp", "vhgp")}
    every = np.concatenate(list(kl.values()))
    scale = ColourScale(max(float(every.min()), 1e-3), float(every.max()), "viridis", "neither")
    maps = []
    for kind, values in kl.items():
        shown = grid.as_map(np.repeat(values[:, None], 3, axis=1))[..., 0]
        title = f"KL(repetitions || {KIND_NAMES[kind]})"
        maps.append(Map(title, grid.fractions, grid.angles, shown, scale, "KL (nats)", logarithmic=True))
    return picture(
        study.out / "divergence_maps.png",
        (8.0, 3.4),
        partial(paint_maps, rows=[("", maps)]),
        f"Maps of the KL divergence over contact and angle for GP and VHGP. {len(grid.seen)} simulated pushes on "
        f"{grid.surface}, three outputs, mean of {study.plan.seeds} seeds, one log scale; grey: too few repetitions.",
    )
