# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models that were trained at one speed and are asked at others: docs/results/accuracy.md.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.models.other_speeds [--rigs simulated foreign points] [--count 3]
        [--rows 300] [--work FOLDER]

Every model learns from 100 pushes at 20 mm/s, and predicts 120 others at 10, 20, 40, 80 and 150 mm/s: at most two
windows a push, so that slow pushes, which have more, count as much. "vhgp auto, all speeds" is trained on 120 pushes at
these speeds. --count: of rigs of each simulator. --rows: random training windows. --work: where the recordings are
kept, a temporary folder by default.

The NMSE is the sum over three outputs, about the mean of the training pushes at all speeds for all models. Intervals
resample whole pushes. The last column is the paired difference of the exact NLPD from the model of all speeds.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.measured.scores import within
from benchmarks.models.rigs_at_speeds import RIGS, session
from benchmarks.support.scripts import parser_of, ruled
from push_predictor.evaluation.estimate import by_push, difference_by_push, total_exact_nlpd, total_nmse
from push_predictor.evaluation.push_scores import PushScores, pooled, push_scores
from push_predictor.evaluation.validation import compare
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable, empty_table

TRAINED, ASKED = 0.02, (0.01, 0.02, 0.04, 0.08, 0.15)  # m/s
PUSHES, TEST_PUSHES = 100, 120
MOST_WINDOWS = 2  # of a test push
ALL_SPEEDS = "vhgp auto, all speeds"
MODELS = {
    "vhgp auto": ("vhgp", TrainingOptions()),
    "vhgp mechanics": ("vhgp", TrainingOptions(mean="mechanics")),
    "vhgp zero": ("vhgp", TrainingOptions(mean="zero")),
    "vhgp zero, raw outcomes": ("vhgp", TrainingOptions(mean="zero", per_path=False)),
    "gp auto": ("gp", TrainingOptions()),
    "analytical --fit": ("analytical", TrainingOptions(fit=True)),
    "prior, no pushes": ("prior", TrainingOptions()),
    ALL_SPEEDS: ("vhgp", TrainingOptions()),
}
HEAD = "| model | NMSE (95 %) | exact NLPD (95 %) | within 95 % (dx dy dtheta) | minus all speeds (95 %) |"
BY_SPEED = "| speed, mm/s | windows | exact NLPD, vhgp auto | within 95 % (dx dy dtheta) | exact NLPD, all speeds |"


@dataclass(frozen=True, eq=False)
class Case:
    """Of one rig: training pushes at one speed and at all, and test pushes at all."""

    one: PushTable
    several: PushTable
    test: PushTable
    rig: Rig

    def scores(self, model: str, rows: int) -> PushScores:
        """Scores of a model on the test pushes."""
        kind, options = MODELS[model]
        table = empty_table() if kind == "prior" else self.several if model == ALL_SPEEDS else self.one
        if len(table):
            options = replace(options, n_train=min(rows, len(table)))
        trained = train_model(table, self.rig, kind, name=model, options=options)
        mean = self.several.outcomes.mean(axis=0)
        return push_scores(replace(compare(trained, self.test), training_mean=mean))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables as Markdown."""
    parser = parser_of(__doc__)
    parser.add_argument("--rigs", nargs="+", choices=tuple(RIGS), default=tuple(RIGS))
    parser.add_argument("--models", nargs="+", choices=tuple(MODELS), default=tuple(MODELS))
    parser.add_argument("--count", type=int, default=3)
    parser.add_argument("--rows", type=int, default=300)
    parser.add_argument("--work", type=Path)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        for rig in options.rigs:
            cases = [case_of(rig, number, options.work or Path(temporary)) for number in range(options.count)]
            print_rig(rig, cases, options.models, options.rows)


def case_of(rig: str, number: int, work: Path) -> Case:
    """The pushes of a rig; those of the test are named by its number and their speed."""
    one, known = session(rig, number, 0, PUSHES, (TRAINED,), work)
    several, test = (session(rig, number, which, TEST_PUSHES, ASKED, work)[0] for which in (1, 2))
    test = test.take(few_windows(test))
    near = np.abs(np.log(test.inputs[:, :1] / np.array(ASKED))).argmin(axis=1)
    names = [f"{number} {ASKED[k]} {push}" for k, push in zip(near, test.push_id, strict=True)]
    return Case(one, several, replace(test, push_id=np.array(names)), known)


def few_windows(table: PushTable) -> np.ndarray:
    """Random rows of the table, at most MOST_WINDOWS of a push."""
    order = np.random.default_rng(0).permutation(len(table))
    counts: dict[str, int] = {}
    chosen = []
    for row in order:
        push = str(table.push_id[row])
        counts[push] = counts.get(push, 0) + 1
        if counts[push] <= MOST_WINDOWS:
            chosen.append(row)
    return np.sort(chosen)


def at_speed(scores: PushScores, speed: float) -> PushScores:
    """The scores of the pushes at one of the speeds."""
    chosen = np.array([name.split()[1] == str(speed) for name in scores.push_id])
    return PushScores(**{field: values[chosen] for field, values in vars(scores).items()})


def print_rig(rig: str, cases: Sequence[Case], models: Sequence[str], rows: int) -> None:
    """Print the tables of a simulator."""
    found = {}
    for model in dict.fromkeys((*models, ALL_SPEEDS)):
        found[model] = pooled([case.scores(model, rows) for case in cases])
    pushes = sum(len(case.test.pushes) for case in cases)
    windows = sum(len(case.test) for case in cases)
    print(f"\n{rig}: {windows} windows of {pushes} pushes on {len(cases)} rigs\n\n{ruled(HEAD)}")
    best = found[ALL_SPEEDS]
    for model, scores in found.items():
        nmse, nlpd = by_push(scores, total_nmse).text(".3f"), by_push(scores, total_exact_nlpd).text(".2f")
        difference = "" if scores is best else difference_by_push(best, scores, total_exact_nlpd).text("+.2f")
        print(f"| {model} | {nmse} | {nlpd} | {within(scores)} | {difference} |")
    if "vhgp auto" not in found:
        return
    print(f"\n{ruled(BY_SPEED)}")
    for speed in ASKED:
        default, there = (at_speed(found[model], speed) for model in ("vhgp auto", ALL_SPEEDS))
        count = int(default.windows.sum())
        own, best_there = (by_push(scores, total_exact_nlpd).text(".2f") for scores in (default, there))
        print(f"| {1e3 * speed:g} | {count} | {own} | {within(default)} | {best_there} |", flush=True)


if __name__ == "__main__":
    main()
