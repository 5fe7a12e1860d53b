# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Do pushes that `suggest` chooses teach more than random ones? A table for docs/results/prior.md.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.models.active --data FOLDER [--sizes 5 10 20 40] [--draws 3]

Whole pushes of the measured square are chosen from four of five folds, and the fifth is predicted. A VHGP about fitted
mechanics grows to these sizes: of its pool, suggestion sees the inputs of all pushes and the outcomes of those that it
has chosen; the first batch is chosen by a prior model. Random pushes are drawn several times. Differences
are paired, and intervals (95 %) resample the predicted pushes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.models.accuracy import compared
from benchmarks.models.cases import Case, in_temporary_folder
from benchmarks.support.scripts import parser_of, piped, ruled
from push_predictor.design.batch import information_of
from push_predictor.design.candidates import Courses
from push_predictor.evaluation.estimate import by_push, difference_by_push, total_exact_nlpd, total_nmse
from push_predictor.evaluation.push_scores import PushScores, pooled, push_scores
from push_predictor.models.pushes import Push
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable, empty_table
from push_predictor.types import IntArray

MODEL, MECHANICS = "vhgp-mechanics", TrainingOptions(mean="mechanics")
WINDOWS, LOOKED_AT = 12, 6  # of a push: that a model is trained on, and that count in the choice
MATTER = 128  # windows of the pool for whose predictions pushes are chosen
FIGURES = ((total_nmse, ".3f"), (total_exact_nlpd, ".2f"))
HEAD = "| pushes | NMSE, random | suggested | difference | exact NLPD, random | suggested | difference |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table as Markdown."""
    parser = parser_of(__doc__)
    parser.add_argument("--data", type=Path, required=True, help="the folder of the measured data")
    parser.add_argument("--sizes", nargs="+", type=int, default=(5, 10, 20, 40), help="numbers of pushes")
    parser.add_argument("--draws", type=int, default=3, help="draws of random pushes")
    options = parser.parse_args(arguments)
    (cases,) = in_temporary_folder(["mit-square"], options.data).values()
    cases = [replace(case, training=thinned(case.training)) for case in cases]
    suggested = [suggested_pushes(case, options.sizes) for case in cases]
    print(ruled(HEAD))
    for place, n in enumerate(options.sizes):
        draws = [random_pushes(case, n, draw) for draw in range(options.draws) for case in cases]
        random = pooled([scored(case, chosen) for case, chosen in zip(cases * options.draws, draws, strict=True)])
        chosen = pooled([scored(case, of[place]) for case, of in zip(cases, suggested, strict=True)])
        row = [str(n)]
        for figure, form in FIGURES:
            row += [by_push(scores, figure).text(form) for scores in (random, chosen)]
            row.append(difference_by_push(random, chosen, figure).text(form))
        print(piped(row), flush=True)


def thinned(table: PushTable) -> PushTable:
    """At most WINDOWS windows of each push, evenly over its rows."""
    return table.take(np.concatenate([evenly(np.flatnonzero(table.push_id == push), WINDOWS) for push in table.pushes]))


def evenly(rows: IntArray, most: int) -> IntArray:
    """At most so many of the rows."""
    return np.asarray(rows[np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int)])


def random_pushes(case: Case, n: int, draw: int) -> list[str]:
    """Names of n pushes of the pool; fewer are a subset of more."""
    names = np.random.default_rng([draw, case.seed]).permutation(np.array(case.training.pushes))
    return [str(name) for name in names[:n]]


def suggested_pushes(case: Case, sizes: Sequence[int]) -> list[list[str]]:
    """The pushes chosen up to each size, with a model of those before."""
    model, chosen, found = train_model(empty_table(), case.rig, "prior", name="prior"), list[str](), []
    for n in sizes:
        left = [push for push in case.training.pushes if push not in chosen]
        tried = courses(case.training, left)
        information, order = information_of(model, tried, matter(case.training)), list[int]()
        for _ in range(n - len(chosen)):
            gains = information.gains()
            gains[order] = -np.inf  # a recorded push cannot be made again
            order.append(int(np.argmax(gains)))
            information.observe(order[-1])
        chosen = [*chosen, *(left[k] for k in order)]
        model = train_model(rows_of(case.training, chosen), case.rig, "vhgp", name=MODEL, options=MECHANICS)
        found.append(chosen)
    return found


def rows_of(table: PushTable, pushes: Sequence[str]) -> PushTable:
    """The windows of these pushes."""
    return table.take(np.isin(table.push_id, pushes))


def scored(case: Case, pushes: Sequence[str]) -> PushScores:
    """Scores of a model of these pushes."""
    return push_scores(compared(case, rows_of(case.training, pushes), MODEL))


def courses(table: PushTable, pushes: Sequence[str]) -> Courses:
    """Some windows of each push as what it would tell."""
    inputs, kept = np.zeros((len(pushes), LOOKED_AT, 3)), np.zeros((len(pushes), LOOKED_AT), dtype=np.bool_)
    for k, push in enumerate(pushes):
        rows = evenly(np.flatnonzero(table.push_id == push), LOOKED_AT)
        inputs[k, : len(rows)], kept[k, : len(rows)] = table.inputs[rows], True
    return Courses(inputs, kept, float(np.median(table.duration)))


def matter(table: PushTable) -> Push:
    """Windows evenly over the pool."""
    rows = evenly(np.arange(len(table)), MATTER)
    return Push(table.inputs[rows], table.duration[rows], {})


if __name__ == "__main__":
    main()
