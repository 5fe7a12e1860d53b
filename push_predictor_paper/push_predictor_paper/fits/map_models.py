# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Learned models evaluated on whole maps over contact and angle, at the speed of the repeated pushes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.types import Array
from push_predictor_paper.data.corpus import Corpus, Pair, PushSet
from push_predictor_paper.data.repetitions import RepeatedGrid, contact_on_first_side
from push_predictor_paper.fits.fit import Answer, Fit, ask, trainable
from push_predictor_paper.plan import GRID_SPEED
from push_predictor_paper.study import Study
from push_predictor_paper.work import Work

FRACTIONS = np.linspace(0.0055, 0.9945, 41)
ANGLES = np.linspace(-1.5, 1.5, 61)
SAME_SPEED = 0.1  # relative; a set needs windows this close to the grid's speed
Question = tuple[Corpus, Pair, Fit, RepeatedGrid | None]


@dataclass(frozen=True, eq=False)
class ModelMap:
    """What a model predicts. mean, sd, process_sd: maps (61, 41, 3) over ANGLES and FRACTIONS, NaN outside the domain
    of its training; at_pushes: of the pushes of a grid, at the inputs as measured, None where no grid was asked for."""

    mean: Array
    sd: Array
    process_sd: Array
    at_pushes: Answer | None


def reference_maps(study: Study, kind: str, seeds: int = 1) -> list[ModelMap]:
    """Maps of models of the reference pair, one for each draw of training windows."""
    corpus, grid = study.simulated, study.reference_grid
    fits = [_all_rows(study, corpus, corpus.reference, kind, seed) for seed in range(seeds)]
    return model_maps(study.work, [(corpus, corpus.reference, fit, grid) for fit in fits])


def surface_maps(study: Study, kind: str) -> dict[str, ModelMap]:
    """Maps of one model for every surface with a grid and a training set of the grid's shape."""
    corpus = study.simulated
    pairs = {s: ((grid.shape, s), grid) for s, grid in study.grids.items() if (grid.shape, s) in corpus.sets}
    asked: list[Question] = [(corpus, p, _all_rows(study, corpus, p, kind, 0), grid) for p, grid in pairs.values()]
    return dict(zip(pairs, model_maps(study.work, asked), strict=True))


def square_maps(study: Study, corpus: Corpus) -> list[ModelMap]:
    """Maps of VHGPs of a corpus' reference set if it is a square pushed at about the grid's speed; else empty."""
    speed = corpus.sets[corpus.reference].table.inputs[:, 0]
    if corpus.reference[0] != "rect1" or not np.any(np.abs(speed - GRID_SPEED) <= SAME_SPEED * GRID_SPEED):
        return []
    fits = [_all_rows(study, corpus, corpus.reference, "vhgp", seed) for seed in range(study.plan.seeds)]
    grid = study.reference_grid if corpus is study.simulated else None
    return model_maps(study.work, [(corpus, corpus.reference, fit, grid) for fit in fits])


def model_maps(work: Work, questions: Sequence[Question]) -> list[ModelMap]:
    """Train these models and evaluate them."""
    calls = [(c.sets[pair], fit, _inputs(c.sets[pair], grid)) for c, pair, fit, grid in questions]
    return [_map(answer) for answer in work.run("models asked for maps", ask, calls)]


def averaged(models: Sequence[ModelMap]) -> ModelMap:
    """Mean map of models of several draws of training windows; known where all of them are."""
    mean, sd, process_sd = (
        np.mean([getattr(m, what) for m in models], axis=0) for what in ("mean", "sd", "process_sd")
    )
    return ModelMap(mean, sd, process_sd, None)


def together(answers: Sequence[Answer]) -> Answer:
    """Mean of the predictions of such models for the same pushes."""
    mean, sd, process_sd = (
        np.mean([getattr(a, what) for a in answers], axis=0) for what in ("mean", "sd", "process_sd")
    )
    return Answer(mean, sd, process_sd, np.all([a.in_domain for a in answers], axis=0))


def _all_rows(study: Study, corpus: Corpus, pair: Pair, kind: str, seed: int) -> Fit:
    whole = Fit(kind, study.plan.size, "none", seed)
    return Fit(kind, min(study.plan.size, trainable(corpus.sets[pair], whole)), "none", seed)


def _inputs(pushes: PushSet, grid: RepeatedGrid | None) -> Array:
    """The inputs of the map, followed by those of the grid's pushes."""
    angle, fraction = (part.ravel() for part in np.meshgrid(ANGLES, FRACTIONS, indexing="ij"))
    contact = contact_on_first_side(pushes.rig.outline, fraction)
    speed = np.clip(GRID_SPEED, pushes.table.inputs[:, 0].min(), pushes.table.inputs[:, 0].max())
    inputs = np.column_stack([np.full(angle.size, speed), contact, angle])
    return inputs if grid is None or not grid.seen else np.vstack([inputs, grid.typical_inputs])


def _map(answer: Answer) -> ModelMap:
    count = len(ANGLES) * len(FRACTIONS)
    known = answer.in_domain[:count, None]
    mean, sd, process_sd = (
        np.where(known, values[:count], np.nan).reshape(len(ANGLES), len(FRACTIONS), 3)
        for values in (answer.mean, answer.sd, answer.process_sd)
    )
    if len(answer.mean) == count:
        return ModelMap(mean, sd, process_sd, None)
    pushes = Answer(answer.mean[count:], answer.sd[count:], answer.process_sd[count:], answer.in_domain[count:])
    return ModelMap(mean, sd, process_sd, pushes)
