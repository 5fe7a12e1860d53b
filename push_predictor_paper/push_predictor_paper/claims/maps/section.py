# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's maps of mean and standard deviation over contact and angle, of model and repetitions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from push_predictor.recordings.table import OUTPUTS
from push_predictor.reporting.canvas import Picture, draw
from push_predictor.types import Array
from push_predictor_paper.claims.maps.agreement import (
    Likenesses,
    agreement_findings,
    agreement_json,
    agreement_table,
    likenesses,
)
from push_predictor_paper.claims.maps.peaks import (
    NAMED,
    PART,
    Peaks,
    model_peaks,
    peak_cells,
    peak_findings,
    peak_json,
    peak_table,
    peaks_of,
    region,
)
from push_predictor_paper.data.repetitions import RepeatedGrid, Repetitions
from push_predictor_paper.figures.repetition_maps import paint_differences, paint_map_figure
from push_predictor_paper.fits.fit import Answer
from push_predictor_paper.fits.map_models import (
    ANGLES,
    FRACTIONS,
    ModelMap,
    averaged,
    reference_maps,
    square_maps,
    together,
)
from push_predictor_paper.section import Finding, Section
from push_predictor_paper.statistics.grid_maps import BLOCK, DRAWS, at_places, in_degrees, on_grid, redrawn
from push_predictor_paper.study import Study

FEWEST_PUSHES = 8
TITLE = "Maps of mean and standard deviation"
CLOSE = 2.0  # standard errors


def section(study: Study) -> Section:
    """Maps, the places of their maxima, and the agreement of model and repetitions."""
    grid = study.reference_grid
    if len(grid.seen) < FEWEST_PUSHES:
        few = f"Only {len(grid.seen)} pushes of the grid have enough repetitions; {FEWEST_PUSHES} are required."
        return Section(
            "maps", TITLE, (Finding("The model's maps agree with those of the repetitions", "not decided", few),)
        )
    models = reference_maps(study, "vhgp", study.plan.seeds)
    plain = reference_maps(study, "gp", study.plan.seeds)
    answers = {
        name: [m.at_pushes for m in maps if m.at_pushes is not None] for name, maps in (("VHGP", models), ("GP", plain))
    }
    alike, peaks = likenesses(grid.seen, answers), peaks_of(grid, models)
    shown, answer = averaged(models), together(answers["VHGP"])
    return Section(
        key="maps",
        title=TITLE,
        findings=(*peak_findings(peaks, len(grid.seen)), *agreement_findings(alike, len(grid.seen))),
        tables=(peak_table(peaks, _peak_caption(study)), agreement_table(alike, _agreement_caption(study))),
        pictures=(
            _map_picture(study, shown, answer, "mean"),
            _map_picture(study, shown, answer, "sd"),
            _difference_picture(study, _differences(grid, answer)),
        ),
        notes=(*NOTES, _other_sign(grid), *_measured_notes(study)),
        data=_json(peaks, alike),
    )


def _json(peaks: Peaks, alike: Likenesses) -> dict[str, Any]:
    return {
        "repetitions": {name: peak_json(peaks.repeated[k]) for k, name in enumerate(OUTPUTS)},
        "vhgp": {name: peak_json(peaks.learned[k]) for k, name in enumerate(OUTPUTS)},
        "handedness_deg": [estimate.json() for estimate in peaks.handedness],
        "agreement": agreement_json(alike),
    }


NOTES = (
    "Signs: our contact runs counter-clockwise along the side, our angle counter-clockwise from the inward normal. The "
    "paper mirrors one of the two, so its (0.75, +30°) is our (0.75, −30°). For the rotation the paper names two "
    "places: (0.75, ±30°) in its text, (1.0, 0) in the example of its figure.",
    "Friction in the simulator is an assumption. It determines where a push sticks or slips, and so where dy and the "
    "rotation are largest. That dx is largest where the push goes through the middle and sticks is geometry.",
    "The ridge of dx runs through all pushes that aim at the slider's centre and stick. Differences along it are "
    "fractions of a per cent.",
    "The sd of an outcome, of VHGP and GP, includes noise and the uncertainty of the mean, as in the paper's maps. "
    "Repetitions show the noise alone. The table lists both.",
)


def examples(grid: RepeatedGrid, answer: Answer, quantity: str) -> list[tuple[Repetitions, Array]]:
    """Per output the push with the largest |mean| or sd, and the model's mean for it."""
    known = np.abs([getattr(cell, quantity) for cell in grid.seen])
    return [(grid.seen[k], answer.mean[k]) for k in known.argmax(axis=0)]


def _differences(grid: RepeatedGrid, answer: Answer) -> list[tuple[str, Array, Array]]:
    """Maps of model minus repetitions for mean and sd, in SI and in standard errors of the repetitions."""
    means, sds = redrawn(grid.seen)
    found = []
    for name, model, drawn in (("mean", answer.mean, means), ("sd", answer.sd, sds)):
        less = model - np.array([getattr(cell, name) for cell in grid.seen])
        found.append((name, on_grid(grid, less), on_grid(grid, less / drawn.std(axis=0))))
    return found


def _other_sign(grid: RepeatedGrid) -> str:
    """A note on the paper's push for dy with the opposite sign of its angle."""
    places = [(contact, -angle) for contact, angle in NAMED["dy"]]
    reach = at_places(grid.fractions, grid.angles, np.abs(grid.mean[None, ..., 1]), places).mean() / np.nanmax(
        np.abs(grid.mean[..., 1])
    )
    return (
        "The paper gives the place for dy in a caption only, so its handedness is uncertain. With the sign of the "
        f"angle as printed, that push would reach {reach:.0%} of the largest |dy| by repetitions."
    )


def _map_picture(study: Study, model: ModelMap, answer: Answer, quantity: str) -> Picture:
    grid, what = study.reference_grid, "mean" if quantity == "mean" else "standard deviation"
    shown = (FRACTIONS, ANGLES, getattr(model, quantity))
    chosen = examples(grid, answer, quantity)
    path = draw(
        study.out / f"maps_{quantity}.png",
        (9.0, 8.6),
        lambda figure: paint_map_figure(figure, grid, quantity, shown, chosen),
    )
    return Picture(
        path,
        f"Maps of the {what} of dx, dy and rotation over contact and angle: VHGP, example pushes, repetitions",
        f"The {what} of the outcome of a push of 0.2 s at 20 mm/s, square on {grid.surface}, simulated. Above: VHGP "
        f"of {_windows(study)} training windows, mean of {study.plan.seeds} maps. Below: {len(grid.seen)} pushes, "
        f"{grid.cells[0].commanded} repetitions each. One colour scale per column; hatched: the tip slid off too "
        f"early, or outside the training data. Between: the push with the column's largest {what} by repetitions "
        "(circle in both maps), seen from above, pushed to the right. Grey: start; thin red: repetitions; red: "
        "their mean; dashed blue: the VHGP's mean.",
    )


def _difference_picture(study: Study, differences: list[tuple[str, Array, Array]]) -> Picture:
    path = draw(
        study.out / "maps_difference.png",
        (9.0, 9.2),
        lambda figure: paint_differences(figure, study.reference_grid, differences),
    )
    shares = "; ".join(f"{name}: {_close_shares(errors)}" for name, _, errors in differences)
    return Picture(
        path,
        "Maps of the VHGP minus the repetitions, in mm and degrees and in standard errors, for mean and standard "
        "deviation",
        f"VHGP (mean of {study.plan.seeds} maps) minus repetitions: in mm and degrees, and in standard errors of the "
        "repetitions (bootstrap). If the model were exact, 95 % of the pushes would lie within two standard errors. "
        f"Shares within {CLOSE:g}, of dx, dy, rotation: {shares}.",
    )


def _close_shares(differences: Array) -> str:
    known = differences[np.isfinite(differences[..., 0])]
    return ", ".join(f"{share:.0%}" for share in np.mean(np.abs(known) <= CLOSE, axis=0))


def _peak_caption(study: Study) -> str:
    grid = study.reference_grid
    return (
        f"Where the absolute mean is largest. Simulated square on {grid.surface}, 20 mm/s, 0.2 s. Repetitions: "
        f"{len(grid.seen)} pushes of the grid, {grid.cells[0].commanded} each, {DRAWS} resamples. VHGP: "
        f"{study.plan.seeds} draws of {_windows(study)} training windows, none of the grid; place of the mean map, "
        "interval over draws. For repetitions, a basic bootstrap removes the bias from picking the largest of noisy "
        "means. Last column: the mean at the paper's push over the largest."
    )


def _agreement_caption(study: Study) -> str:
    return (
        "Agreement of the models' maps with those of the repetitions. Simulated square on "
        f"{study.reference_grid.surface}, {len(study.reference_grid.seen)} pushes; models of {_windows(study)} "
        f"training windows of another recording, mean over {study.plan.seeds} draws. NMSE: squared error over the "
        "map's variance. RMS ratio: model over repetitions. Intervals resample blocks of neighbouring pushes "
        f"({BLOCK[0]:g} of the side × {in_degrees(BLOCK[1])}). The paper shows the maps without numbers; it calls "
        "the means remarkably similar and the deviations well matched to a certain degree."
    )


def _windows(study: Study) -> int:
    return min(study.plan.size, len(study.simulated.sets[study.simulated.reference].table))


def _measured_notes(study: Study) -> Sequence[str]:
    """Notes on the maxima of VHGPs of measured windows."""
    notes = []
    for corpus in study.measured:
        models = square_maps(study, corpus)
        if not models:
            notes.append(f"{corpus.title}: no windows of a square at about 20 mm/s, so there are no maps.")
            continue
        places = []
        for k, found in enumerate(model_peaks(models)):
            cells = peak_cells(found, k)
            value = cells[0].partition("\n")
            places.append(
                f"|{OUTPUTS[k]}| {value[0]} ({value[2]}) at {region(found.places)}, "
                f"the paper's push reaches {found.reach.text(PART)} of it"
            )
        notes.append(
            f"{corpus.title}. VHGPs of {len(models)} draws of training windows are largest at (mm, mm, deg): "
            f"{'; '.join(places)}. There are no repetitions to compare with."
        )
    return notes
