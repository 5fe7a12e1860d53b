# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The models compared with repeated pushes: their training windows and their predictions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.types import IntArray
from push_predictor_paper.claims.divergence.rules import Divergences, divergences
from push_predictor_paper.data.corpus import PushSet
from push_predictor_paper.data.repetitions import RepeatedGrid
from push_predictor_paper.fits.fit import KINDS, Fit, ask
from push_predictor_paper.plan import GRID_SPEED
from push_predictor_paper.study import Study

SPEED_TOLERANCE = 0.2  # of the grid's speed: windows that count as of that speed
FEWEST_WINDOWS = 40  # at the grid's speed, to train on them alone
DRAWN = 0.8  # of these, so that seeds differ


@dataclass(frozen=True, eq=False)
class Training:
    """Training windows: the first n of a draw."""

    name: str
    pushes: PushSet
    n: int


Found = tuple[Training, Mapping[str, Divergences]]  # by kind of model


def trainings(study: Study) -> list[Training]:
    """Training sets: all speeds at the plan's size; if there are enough, the grid's speed only, and as few of all."""
    pushes, slow = study.simulated.sets[study.simulated.reference], slow_windows(study)
    every = Training("all speeds", pushes, min(study.plan.size, len(pushes.table)))
    if len(slow) < FEWEST_WINDOWS:
        return [every]
    n = min(int(DRAWN * len(slow)), study.plan.size)
    alone = replace(pushes, table=pushes.table.take(slow))
    return [every, replace(every, n=n), Training(f"{GRID_SPEED * 1e3:.0f} mm/s only", alone, n)]


def slow_windows(study: Study) -> IntArray:
    """Rows of the reference set near the grid's speed."""
    speed = study.simulated.sets[study.simulated.reference].table.inputs[:, 0]
    return np.flatnonzero(np.abs(speed / GRID_SPEED - 1.0) <= SPEED_TOLERANCE)


def all_divergences(study: Study, grid: RepeatedGrid) -> list[Found]:
    """Train all models, predict the pushes of the grid, and compute the divergences."""
    sets, seeds = trainings(study), range(study.plan.seeds)
    asked = [(t, kind) for t in sets for kind in KINDS]
    calls = [(t.pushes, Fit(kind, t.n, "none", seed), grid.typical_inputs) for t, kind in asked for seed in seeds]
    answers = study.work.run("models of repeated pushes", ask, calls)
    per = [divergences(grid, answers[i : i + len(seeds)]) for i in range(0, len(answers), len(seeds))]
    return [(t, {kind: per[len(KINDS) * i + k] for k, kind in enumerate(KINDS)}) for i, t in enumerate(sets)]
