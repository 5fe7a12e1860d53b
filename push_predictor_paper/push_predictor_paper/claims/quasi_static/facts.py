# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The computations of the quasi-static claim: pushes of equal travel, models of growing brackets of speeds."""

from __future__ import annotations

from dataclasses import dataclass

from push_predictor.evaluation.push_scores import pooled
from push_predictor.recordings.table import PushTable
from push_predictor_paper.claims.quasi_static.rules import Judged
from push_predictor_paper.data.time_scaled import (
    Bracket,
    EqualTravel,
    equal_travel,
    score_bracket,
    speed_windows,
    training_rows,
)
from push_predictor_paper.study import Study

FEWEST, MOST = 10, 50  # training windows of a speed
EQUAL = 200  # training windows of the control, in every bracket
MAIN, GP, SAME_SIZE, WITH_SPEED = "VHGP", "GP", "VHGP, equal n", "VHGP with speed as input"
SERIES = (MAIN, GP, SAME_SIZE, WITH_SPEED)


@dataclass(frozen=True, eq=False)
class Facts:
    """The results: pushes of equal travel by speed, windows by speed, scores. rows: training windows of each speed."""

    pushes: int
    speeds: tuple[float, ...]
    equal: tuple[EqualTravel, ...]
    windows: tuple[PushTable, ...]
    judged: Judged
    rows: int
    same_size: int

    def size(self, series: str, bracket: int) -> int:
        """The number of training windows of a bracket."""
        return _rows(series, bracket + 1, self.rows, self.same_size) * (bracket + 1)

    @property
    def same_sizes(self) -> str:
        """Training windows of the brackets of equal n, in words; rounding makes them differ."""
        sizes = sorted({self.size(SAME_SIZE, k) for k in range(len(self.judged.speeds))})
        return f"{sizes[0]}" if len(sizes) == 1 else f"{sizes[0]} to {sizes[-1]}"

    @property
    def judged_on(self) -> str:
        """The pushes, the split and the kind of interval, in words."""
        return (
            f"{len(self.judged.scores[MAIN][-1].push_id)} held-out pushes, whole pushes held out; intervals "
            "resample folds with their models, and pushes within."
        )


def facts_of(study: Study) -> Facts:
    """Simulate, train and score all models."""
    plan, pair = study.plan, study.simulated.reference
    calls = [(plan, *pair, number) for number in range(len(plan.speeds))]
    windows = study.work.run("pushes of equal travel", speed_windows, calls)
    equal = study.work.run("the same pushes at every speed", equal_travel, calls)
    folds = range(plan.seeds)
    least = [min(len(training_rows(w, Bracket(MAIN, 1, len(w), False, fold))) for fold in folds) for w in windows]
    numbers = tuple(k for k, count in enumerate(least) if count >= FEWEST)
    usable = [windows[k] for k in numbers]
    rows = min([MOST, *(least[k] for k in numbers)])
    same_size = min([EQUAL, *(least[k] * (place + 1) for place, k in enumerate(numbers))])
    brackets = {
        (series, k, fold): _bracket(series, k + 1, fold, rows, same_size)
        for series in SERIES
        for k in range(len(numbers))
        for fold in folds
    }
    rig = study.simulated.sets[pair].rig
    done = study.work.run("models of time-scaled pushes", score_bracket, [(usable, rig, b) for b in brackets.values()])
    found = dict(zip(brackets, done, strict=True))
    scores = {s: [pooled([found[s, k, f] for f in folds]) for k in range(len(numbers))] for s in SERIES}
    judged = Judged(tuple(plan.speeds[k] for k in numbers), numbers, scores)
    return Facts(plan.speed_pushes, plan.speeds, tuple(equal), tuple(windows), judged, rows, same_size)


def _bracket(series: str, speeds: int, fold: int, rows: int, same_size: int) -> Bracket:
    kind = "gp" if series == GP else "vhgp"
    return Bracket(kind, speeds, _rows(series, speeds, rows, same_size), series == WITH_SPEED, fold)


def _rows(series: str, speeds: int, rows: int, same_size: int) -> int:
    return max(1, same_size // speeds) if series == SAME_SIZE else rows
