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
from push_predictor_paper.fits.fit import Answer, Fit, ask
from push_predictor_paper.plan import GRID_SPEED
from push_predictor_paper.study import Study

FRACTIONS = np.linspace(0.0055, 0.9945, 41)
ANGLES = np.linspace(-1.5, 1.5, 61)
Question = tuple[Corpus, Pair, str, int, RepeatedGrid | None]  # kind, seed


@dataclass(frozen=True, eq=False)
class ModelMap:
    """What a model predicts. mean, sd, process_sd: maps (61, 41, 3) over ANGLES and FRACTIONS, NaN outside the domain
    of its training; at_pushes: of the pushes of a grid, at the inputs as measured, None where no grid was asked for."""

    mean: Array
    sd: Array
    process_sd: Array
    at_pushes: Answer | None


def reference_maps(study: Study, kind: str) -> list[ModelMap]:
    """Maps of models of the reference pair, one for each draw of training windows."""
    corpus, seeds = study.simulated, range(study.plan.seeds)
    return _maps(study, [(corpus, corpus.reference, kind, seed, study.reference_grid) for seed in seeds])


def surface_maps(study: Study, kind: str) -> dict[str, ModelMap]:
    """Maps of one model for every surface with a grid and a training set of the grid's shape."""
    corpus = study.simulated
    shown = {s: grid for s, grid in study.grids.items() if (grid.shape, s) in corpus.sets}
    return dict(zip(shown, _maps(study, [(corpus, (g.shape, s), kind, 0, g) for s, g in shown.items()]), strict=True))


def averaged(models: Sequence[ModelMap]) -> ModelMap:
    """Mean map of models of several draws of training windows; known where all of them are."""
    mean, sd, process_sd = (np.mean([getattr(m, of) for m in models], axis=0) for of in ("mean", "sd", "process_sd"))
    return ModelMap(mean, sd, process_sd, None)


def _maps(study: Study, questions: Sequence[Question]) -> list[ModelMap]:
    """Train models of all rows, or of the plan's size, and evaluate them."""
    calls = []
    for corpus, pair, kind, seed, grid in questions:
        pushes = corpus.sets[pair]
        calls.append((pushes, Fit(kind, study.size_of(pushes), "none", seed), _inputs(pushes, grid)))
    return [_map(answer) for answer in study.work.run("models asked for maps", ask, calls)]


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
