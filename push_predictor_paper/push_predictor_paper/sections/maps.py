# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's maps of mean and standard deviation over contact and angle, of model and repetitions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.estimate import Estimate, of_draws
from push_predictor.evaluation.report.maps import colour_scale
from push_predictor.recordings.table import OUTPUTS
from push_predictor.reporting.canvas import SYMBOLS, UNIT_NAMES, UNITS, Picture
from push_predictor.types import Array
from push_predictor_paper.data.repetitions import FEWEST, RepeatedGrid, Repetitions
from push_predictor_paper.estimate import over_seeds
from push_predictor_paper.fits.fit import Answer
from push_predictor_paper.fits.map_models import ANGLES, FRACTIONS, ModelMap, averaged, reference_maps
from push_predictor_paper.painters.maps import Map, paint_maps
from push_predictor_paper.painters.trajectories import paint_outcomes
from push_predictor_paper.section import OUTPUT_NAMES, Section, TooFewError, picture
from push_predictor_paper.statistics.grid_maps import (
    FEWEST_PUSHES,
    OF_BLOCKS,
    Peak,
    Place,
    at_places,
    block_weights,
    by_blocks,
    correlation,
    peak,
    place_text,
    redrawn,
    unbiased,
)
from push_predictor_paper.study import Study
from push_predictor_paper.verdict import Bound, Evidence, Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TURNED = float(np.radians(30.0))
# In our handedness: the paper's angles change their sign (its contact and angle are mirrored against each other).
NAMED: dict[str, tuple[Place, ...]] = {
    "dx": ((0.5, 0.0),),
    "dy": ((0.7, -0.7), (0.3, 0.7)),
    "dtheta": ((0.75, -TURNED), (0.25, TURNED)),
}
MIRRORED: tuple[Place, ...] = ((0.75, TURNED), (0.25, -TURNED))
PEAK_CLAIMS = ("forward", "sideways", "turning")  # by output
ONE_STEP = Bound(high=1.0 + 1e-6)
QUANTITIES = ("mean", "sd")
NOTES = (
    "Signs: our contact runs counter-clockwise along the side, our angle counter-clockwise from the inward normal. The "
    "paper mirrors one of the two, so its (0.75, +30°) is our (0.75, −30°). For the rotation it names two places: "
    "(0.75, ±30°) in its text, (1.0, 0) in the example of its figure. It gives that for dy in a caption only, so its "
    "handedness is uncertain.",
    "Friction in the simulator is an assumption. It determines where a push sticks or slips, and so where dy and the "
    "rotation are largest. That dx is largest where a push goes through the middle and sticks is geometry: along that "
    "ridge it varies by fractions of a per cent.",
    "The sd of an outcome, of VHGP and GP, includes noise and the uncertainty of the mean, as in the paper's maps. "
    "Repetitions show the noise alone.",
)


@dataclass(frozen=True)
class Peaks:
    """Largest |dx|, |dy|, |dtheta|: by repetitions, and by models of several draws of training rows.

    handedness: rotation (deg) of the paper's push minus that of its mirror image, by repetitions and by the models.
    """

    repeated: tuple[Peak, ...]
    learned: tuple[Peak, ...]
    handedness: tuple[Estimate, Estimate]


Likenesses = Mapping[tuple[str, str], Sequence[Estimate]]  # by quantity and model: correlations of the outputs


def section(study: Study) -> Section:
    """Maps, the places of their maxima, and the agreement of model and repetitions."""
    grid = study.reference_grid
    if len(grid.seen) < FEWEST_PUSHES:
        raise TooFewError(f"Only {len(grid.seen)} pushes of the grid have {FEWEST} repetitions; {FEWEST_PUSHES} must.")
    models = reference_maps(study, "vhgp")
    plain = reference_maps(study, "gp")
    answers = {
        name: [m.at_pushes for m in maps if m.at_pushes is not None] for name, maps in (("VHGP", models), ("GP", plain))
    }
    alike, shown = likenesses(grid.seen, answers), averaged(models)
    predicted = np.mean([answer.mean for answer in answers["VHGP"]], axis=0)
    return Section(
        {**peak_evidence(peaks_of(grid, models)), **agreement_evidence(alike)},
        pictures=[_picture(study, shown, predicted, quantity) for quantity in ("mean", "sd")],
        notes=(*NOTES, OF_BLOCKS),
    )


def peaks_of(grid: RepeatedGrid, models: Sequence[ModelMap]) -> Peaks:
    """Find all peaks; models: one per draw of training rows."""
    shown, drawn = np.abs(grid.mean), np.abs(grid.as_map(redrawn(grid.seen)[0]))
    mean, seeds = np.abs(averaged(models).mean), np.abs([model.mean for model in models])
    repeated = _peaks(grid.fractions, grid.angles, shown, drawn, unbiased)
    # the place is that of the mean map, the value the mean over the draws
    learned = _peaks(FRACTIONS, ANGLES, mean, seeds, lambda _, draws: over_seeds(draws.tolist()))
    turned = (
        _handedness(grid.fractions, grid.angles, np.concatenate([shown[None], drawn])[..., 2]),
        _handedness(FRACTIONS, ANGLES, seeds[..., 2]),
    )
    handedness = (of_draws(float(turned[0][0]), turned[0][1:]), over_seeds(turned[1].tolist()))
    return Peaks(repeated, learned, handedness)


def peak_evidence(peaks: Peaks) -> dict[str, Evidence]:
    """Where each output is largest, by repetitions and by the VHGP, and the handedness of the rotation."""
    found = {}
    for k, key in enumerate(PEAK_CLAIMS):
        named = NAMED[OUTPUTS[k]]
        sources = {"repetitions": peaks.repeated[k], "VHGP": peaks.learned[k]}
        figures = [Figure(f"{name}, reached", p.reach) for name, p in sources.items()]
        if key != "sideways":  # the paper states only that the slider moves far
            near = [Figure(f"{name}, steps away", p.steps_from(named), ONE_STEP) for name, p in sources.items()]
            figures = near + figures
        largest = "; ".join(
            f"by {name} {p.value.times(UNITS[k]).text()} {UNIT_NAMES[k]} at {place_text(p.place)}"
            for name, p in sources.items()
        )
        paper = " or ".join(map(place_text, named))
        found[key] = Evidence(figures, f"Largest: {largest}. The paper's push, in our signs: {paper}.")
    turned = [Figure(name, e) for name, e in zip(("repetitions", "VHGP"), peaks.handedness, strict=True)]
    geometry = "Geometry suggests it: the force has a longer lever about the centre."
    return {**found, "handedness": Evidence(turned, geometry)}


def likenesses(cells: list[Repetitions], answers: Mapping[str, Sequence[Answer]]) -> Likenesses:
    """Correlations of the models' maps of mean and sd of an outcome with those of the repetitions, at these pushes.

    answers: by model, one for each draw of its training windows; the results are averaged over them.
    """
    weights = block_weights(cells)

    def alike(quantity: str, draws: Sequence[Answer], k: int) -> Estimate:
        known = np.array([getattr(cell, quantity)[k] for cell in cells])
        shown = [getattr(answer, quantity)[:, k] for answer in draws]
        return by_blocks(lambda w: np.mean([correlation(model, known, w) for model in shown], axis=0), weights)

    return {
        (quantity, model): [alike(quantity, draws, k) for k in range(3)]
        for quantity in QUANTITIES
        for model, draws in answers.items()
    }


def agreement_evidence(found: Likenesses) -> dict[str, Evidence]:
    """Do the maps of mean and of standard deviation agree?"""
    plain = ", ".join(f"{name} {like.text()}" for name, like in zip(OUTPUT_NAMES, found["sd", "GP"], strict=True))
    notes = {"mean": "", "sd": f"The GP has one noise level for all pushes: {plain}."}
    return {
        f"{quantity}_map": Evidence(list(map(Figure, OUTPUT_NAMES, found[quantity, "VHGP"])), note)
        for quantity, note in notes.items()
    }


def _peaks(
    fractions: Array, angles: Array, shown: Array, drawn: Array, interval: Callable[[float, Array], Estimate]
) -> tuple[Peak, ...]:
    """The peak of each output of maps (A, C, 3) with draws (d, A, C, 3)."""
    named = [NAMED[name] for name in OUTPUTS]
    return tuple(peak(fractions, angles, shown[..., k], drawn[..., k], named[k], interval) for k in range(3))


def _handedness(fractions: Array, angles: Array, turned: Array) -> Array:
    paper, mirrored = (at_places(fractions, angles, turned, at).mean(axis=1) for at in (NAMED["dtheta"], MIRRORED))
    return np.asarray(np.degrees(paper - mirrored))


def _picture(study: Study, model: ModelMap, predicted: Array, quantity: str) -> Picture:
    """Maps of the mean or sd; predicted: mean outcomes (len(seen), 3) of the grid's pushes by the model."""
    grid, what = study.reference_grid, "mean" if quantity == "mean" else "standard deviation"
    known = np.abs([getattr(cell, quantity) for cell in grid.seen])
    largest = known.argmax(axis=0)  # push of each output
    maps: list[list[Map]] = [[], []]
    for k, push in enumerate(largest):
        both = ((FRACTIONS, ANGLES, getattr(model, quantity)), (grid.fractions, grid.angles, getattr(grid, quantity)))
        scale = colour_scale([values[..., k] * UNITS[k] for _, _, values in both])
        place = (grid.seen[push].fraction, grid.seen[push].angle)
        title = f"{'' if quantity == 'mean' else 'sd of '}{SYMBOLS[k]}"
        for row, (fractions, angles, values) in zip(maps, both, strict=True):
            row.append(Map(title, fractions, angles, values[..., k] * UNITS[k], scale, UNIT_NAMES[k], marked=place))

    def example(ax: Axes, k: int) -> None:
        paint_outcomes(ax, grid.rig, grid.seen[largest[k]], predicted[largest[k]])

    rows = list(zip(("VHGP", "repetitions"), maps, strict=True))
    return picture(
        study.out / f"maps_{quantity}.png",
        (10.0, 7.8),
        partial(paint_maps, rows=rows, below_first=example),
        f"Maps of the {what} of dx, dy and rotation over contact and angle: VHGP, example pushes, repetitions. A push "
        f"of 0.2 s at 20 mm/s, square on {grid.surface}, simulated. Above: VHGP of {_windows(study)} training "
        f"windows, mean of {study.plan.seeds} maps. Below: {len(grid.seen)} pushes, {grid.cells[0].commanded} "
        "repetitions each. Hatched: the tip slid off too early, or outside the training data. Between: the push with "
        f"the column's largest {what} by repetitions (circle in both maps), seen from above, pushed to the right. "
        "Grey: start; thin red: repetitions; red: their mean; dashed blue: the VHGP's mean.",
    )


def _windows(study: Study) -> int:
    return study.size_of(study.simulated.sets[study.simulated.reference])
