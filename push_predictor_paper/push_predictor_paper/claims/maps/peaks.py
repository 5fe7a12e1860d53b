# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Where each output is largest: by repetitions, by the model, and in the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_predictor.recordings.table import OUTPUTS
from push_predictor.types import Array
from push_predictor_paper.data.repetitions import RepeatedGrid
from push_predictor_paper.estimate import Estimate, of_draws, over_seeds
from push_predictor_paper.fits.map_models import ANGLES, FRACTIONS, ModelMap
from push_predictor_paper.section import Finding, Table, Verdict
from push_predictor_paper.statistics.grid_maps import (
    Place,
    at_places,
    in_degrees,
    on_grid,
    place_text,
    redrawn,
    unbiased,
)
from push_predictor_paper.statistics.peaks import Peak, peak

TURNED = float(np.radians(30.0))
# In our handedness: the paper's angles change their sign (its contact and angle are mirrored against each other).
NAMED: dict[str, tuple[Place, ...]] = {
    "dx": ((0.5, 0.0),),
    "dy": ((0.7, -0.7), (0.3, 0.7)),
    "dtheta": ((0.75, -TURNED), (0.25, TURNED)),
}
MIRRORED: tuple[Place, ...] = ((0.75, TURNED), (0.25, -TURNED))
STEP: Place = (0.1, 0.1)  # of the side, rad: the paper's grid
ENOUGH = (np.inf, 0.9, np.inf)  # of the largest; for dy the paper states only that the slider moves far
NEARLY = (0.9, 0.75, 0.9)  # of the largest: holds in part
PART = ".1%"
FEW = 2  # places that are listed one by one
SCALES = (1e3, 1e3, 180.0 / np.pi)
NAMES = ("dx", "dy", "rotation")
UNITS = ("mm", "mm", "deg")
CLAIMS = (
    "The slider moves farthest forward when pushed at the middle of a side, along its normal",
    "The slider moves far sideways when pushed at c = 0.7, β = 40° (the paper's signs)",
    "The slider turns most when pushed between middle and corner, at c = 0.75, β = +30° or c = 0.25, β = −30° "
    "(the paper's signs)",
)


@dataclass(frozen=True)
class Peaks:
    """Largest |dx|, |dy|, |dtheta|: by repetitions, and by models of several draws of training rows.

    handedness: rotation (deg) of the paper's push minus that of its mirror image, by repetitions and by the models.
    """

    repeated: tuple[Peak, ...]
    learned: tuple[Peak, ...]
    handedness: tuple[Estimate, Estimate]


def peaks_of(grid: RepeatedGrid, models: Sequence[ModelMap]) -> Peaks:
    """Find all peaks; models: one per draw of training rows."""
    drawn = np.abs(on_grid(grid, redrawn(grid.seen)[0]))
    shown = np.abs(grid.mean)
    repeated = [
        peak(grid.fractions, grid.angles, shown[..., k], drawn[..., k], NAMED[name], unbiased)
        for k, name in enumerate(OUTPUTS)
    ]
    seeds = np.abs(np.array([model.mean for model in models]))
    turned = (
        _handedness(grid.fractions, grid.angles, np.concatenate([shown[None], drawn])[..., 2]),
        _handedness(FRACTIONS, ANGLES, seeds[..., 2]),
    )
    handedness = (of_draws(float(turned[0][0]), turned[0][1:]), over_seeds(turned[1].tolist()))
    return Peaks(tuple(repeated), model_peaks(models), handedness)


def model_peaks(models: Sequence[ModelMap]) -> tuple[Peak, ...]:
    """Peaks of the mean map of models of several draws of training rows; values are means over the draws."""
    seeds = np.abs(np.array([model.mean for model in models]))

    together = np.abs(np.mean([model.mean for model in models], axis=0))

    def spread(_: float, draws: Array) -> Estimate:
        return over_seeds(draws.tolist())

    return tuple(
        peak(FRACTIONS, ANGLES, together[..., k], seeds[..., k], NAMED[name], spread) for k, name in enumerate(OUTPUTS)
    )


def peak_findings(peaks: Peaks, pushes: int) -> tuple[Finding, ...]:
    """A finding for each output, and one for the handedness of the rotation."""
    return (*(_finding(peaks, k, pushes) for k in range(len(OUTPUTS))), _handedness_finding(peaks))


def peak_table(peaks: Peaks, caption: str) -> Table:
    """A row per output and source: value, place, and the value at the paper's push."""
    head = ("", "largest", "where", "where, in 95 % of the draws", "the paper's push (our signs)", "it reaches")
    rows = []
    for k, name in enumerate(NAMES):
        for source, found in (("repetitions", peaks.repeated[k]), ("VHGP", peaks.learned[k])):
            rows.append((f"|{name}| ({UNITS[k]}), {source}", *peak_cells(found, k)))
    return Table(caption, head, tuple(rows))


def peak_cells(found: Peak, k: int) -> tuple[str, ...]:
    """The cells of a row: output k."""
    paper = " or ".join(place_text(place) for place in NAMED[OUTPUTS[k]])
    value = scaled(found.value, SCALES[k]).cell()
    return value, place_text(found.place), region(found.places), paper, found.reach.cell(PART)


def peak_json(found: Peak) -> dict[str, Any]:
    """Place and value in SI, for the JSON."""
    return {
        "largest": found.value.json(),
        "contact": found.place[0],
        "angle": found.place[1],
        "places": [list(place) for place in found.places],
        "paper_push_reaches": found.reach.json(),
    }


def region(places: Sequence[Place]) -> str:
    """A few places one by one; of more, their range, mirrored onto one half of the side."""
    if len(places) <= FEW:
        return " or ".join(map(place_text, places))
    contacts, angles = np.array([place if place[0] >= 0.5 else (1.0 - place[0], -place[1]) for place in places]).T
    contact = _span([f"{c:.2f}" for c in (contacts.min(), contacts.max())])
    angle = _span([in_degrees(a) for a in (angles.min(), angles.max())])
    return f"c = {contact}, {angle} ({len(places)} pushes, mirrored onto c ≥ 0.5)"


def _span(ends: Sequence[str]) -> str:
    return " to ".join(dict.fromkeys(ends))


def scaled(estimate: Estimate, factor: float) -> Estimate:
    """The estimate in other units."""
    return Estimate(estimate.value * factor, estimate.low * factor, estimate.high * factor)


def agreed(one: Verdict, other: Verdict) -> Verdict:
    """Joint verdict of repetitions and model; in part if the claim holds by one of them only."""
    if one == other:
        return one
    return "holds in part" if {one, other} & {"holds", "holds in part"} else "not decided"


def _finding(peaks: Peaks, k: int, pushes: int) -> Finding:
    named, repeated, learned = NAMED[OUTPUTS[k]], peaks.repeated[k], peaks.learned[k]
    verdict = agreed(_verdict(repeated, k), _verdict(learned, k))
    sentence = (
        f"Largest |{NAMES[k]}| of {pushes} repeated pushes: {scaled(repeated.value, SCALES[k]).text()} {UNITS[k]} at "
        f"{place_text(repeated.place)}; in 95 % of the draws at {region(repeated.places)}. VHGP: at "
        f"{place_text(learned.place)}; over draws of training windows at {region(learned.places)}. The paper's push "
        f"({' or '.join(map(place_text, named))} in our signs) reaches {repeated.reach.text(PART)} of the largest by "
        f"repetitions, {learned.reach.text(PART)} by the VHGP. {_rule(k)}"
    )
    number = f"{scaled(repeated.value, SCALES[k]).text()} {UNITS[k]} at {place_text(repeated.place)}"
    return Finding(CLAIMS[k], verdict, sentence, number=number)


def _verdict(found: Peak, k: int) -> Verdict:
    near, reach = found.near(NAMED[OUTPUTS[k]], STEP), found.reach
    if not np.isfinite(reach.value):
        return "not decided"
    if all(near) or reach.low >= ENOUGH[k]:
        return "holds"
    if any(near) or reach.low >= NEARLY[k]:
        return "holds in part"
    return "does not hold" if reach.high < NEARLY[k] else "not decided"


def _rule(k: int) -> str:
    reached = f", or if that push reaches {ENOUGH[k]:.0%} of it" if np.isfinite(ENOUGH[k]) else ""
    return (
        f"Rule: holds if in all of those draws the largest lies within {STEP[0]:g} of the side and "
        f"{in_degrees(STEP[1])} of the paper's push{reached}; in part if in some of them, or if that push reaches "
        f"{NEARLY[k]:.0%}; does not hold if it reaches less. Reaching is by the whole interval. By repetitions and by "
        "the VHGP; in part if by one of them only."
    )


def _handedness(fractions: Array, angles: Array, turned: Array) -> Array:
    paper, mirrored = (at_places(fractions, angles, turned, at).mean(axis=1) for at in (NAMED["dtheta"], MIRRORED))
    return np.asarray(np.degrees(paper - mirrored))


def _handedness_finding(peaks: Peaks) -> Finding:
    verdicts = [_sign(estimate) for estimate in peaks.handedness]
    repeated, learned = (estimate.text() for estimate in peaks.handedness)
    return Finding(
        "Between middle and corner, a push that leads away from the middle turns the slider more (the paper's "
        "handedness)",
        agreed(verdicts[0], verdicts[1]),
        f"|rotation| at c = 0.75, −30° minus that at +30° (our signs; mean with c = 0.25 mirrored): {repeated} deg "
        f"by repetitions, {learned} deg by the VHGP over draws of training windows. Rule: holds if both intervals lie "
        "above zero, in part if one does, does not hold if both lie below. Geometry suggests it: the force has a "
        "longer lever about the centre.",
        number=f"{repeated} deg",
    )


def _sign(estimate: Estimate) -> Verdict:
    return "holds" if estimate.low > 0.0 else "does not hold" if estimate.high < 0.0 else "not decided"
