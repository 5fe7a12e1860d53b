# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Learnt models about fitted mechanics next to plain ones, by number of windows: docs/results/prior.md.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.measured.informed --data FOLDER [--bags bags] [--sizes N ...]
        [--models vhgp:zero vhgp:mechanics ...]

--data: the folder of the measured data with mit_square, split by push in five folds as in square.py. --bags: the
standard recordings of `simulate`: the square trains on square_abs_train, the other outlines on four of five folds.
n = 0 is the prior model. A row "minus" has paired differences from the plain model of the same kind.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from benchmarks.measured.scores import within
from benchmarks.measured.square import imported_square
from benchmarks.support.scripts import parser_of, ruled
from push_predictor.evaluation.estimate import by_push, difference_by_push, total_exact_nlpd, total_nlpd, total_nmse
from push_predictor.evaluation.push_scores import PushScores, pooled, push_scores
from push_predictor.evaluation.splits import FOLDS, Split, split_by_push
from push_predictor.evaluation.validation import compare
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.models.train_learnt import MeanChoice
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable, empty_table

SIZES = (0, 20, 50, 100, 200, 500, 1000)
MODELS = ("gp:zero", "gp:mechanics", "vhgp:zero", "vhgp:mechanics")
OWN_FOLDS = ("ellipse_plywood", "hexagon_delrin", "circle_pu")
HEAD = "| n | model | NMSE (95 %) | NLPD | exact NLPD (95 %) | within 95 % (dx dy dtheta) | learnt outputs | CPU, s |"


@dataclass(frozen=True, eq=False)
class Case:
    """Rows to draw training windows from, in the order in which they are drawn, and rows to test on."""

    training: PushTable
    test: PushTable
    rig: Rig
    seed: int


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables as Markdown."""
    parser = parser_of(__doc__)
    parser.add_argument("--data", type=Path, help="the folder of the measured data")
    parser.add_argument("--bags", type=Path, help="the folder of the simulated recordings")
    parser.add_argument("--sizes", nargs="+", type=int, default=SIZES)
    parser.add_argument("--models", nargs="+", default=MODELS, metavar="KIND:MEAN")
    options = parser.parse_args(arguments)
    for name, cases in (*measured_cases(options.data), *simulated_cases(options.bags)):
        print(f"\n{name}\n\n{ruled(HEAD)}")
        for n in options.sizes:
            if all(n <= len(case.training) for case in cases):
                rows(cases, n, options.models)


def rows(cases: Sequence[Case], n: int, models: Sequence[str]) -> None:
    """Print the rows of a size."""
    plain: dict[str, PushScores] = {}
    for model in models if n else ["prior:zero"]:
        kind, mean = model.split(":")
        found = [trained(case, n, kind, mean) for case in cases]
        scores = pooled([scored(case, model) for case, (model, _) in zip(cases, found, strict=True)])
        learnt = sum(_learnt(model) for model, _ in found)
        cpu = np.mean([cpu for _, cpu in found])
        print(f"| {n} | {model} | {_cells(scores)} | {learnt} of {3 * len(cases)} | {cpu:.1f} |", flush=True)
        if mean == "zero":
            plain[kind] = scores
        elif kind in plain:
            print(f"| {n} | {model} minus {kind}:zero | {_differences(plain[kind], scores)} | | | |", flush=True)


def trained(case: Case, n: int, kind: str, mean: str, tails: bool = False) -> tuple[PushModel, float]:
    """A model of the first n training windows, and CPU s of training."""
    table = case.training.take(np.arange(n)) if n else empty_table()
    start = time.process_time()
    model = train_model(
        table,
        case.rig,
        kind,
        name=kind,
        options=TrainingOptions(seed=case.seed, mean=cast(MeanChoice, mean), tails=tails),
    )
    return model, time.process_time() - start


def scored(case: Case, model: PushModel) -> PushScores:
    """Scores on the test rows; without training rows, the reference of the NMSE is the mean of all that could be."""
    comparison = compare(model, case.test)
    if not len(model.training):
        comparison = replace(comparison, training_mean=case.training.outcomes.mean(axis=0))
    return push_scores(comparison)


def _learnt(model: PushModel) -> int:
    """Number of outputs with a regression, and not with constant noise."""
    predictor = model.predictor
    if not isinstance(predictor, GaussianProcessPredictor):
        return 0
    return sum(regression.parameters.count > 2 for regression in predictor.regressions)


def _cells(scores: PushScores) -> str:
    nmse, exact = by_push(scores, total_nmse), by_push(scores, total_exact_nlpd)
    return f"{nmse.text('.3f')} | {by_push(scores, total_nlpd).value:.2f} | {exact.text('.2f')} | {within(scores)}"


def _differences(first: PushScores, second: PushScores) -> str:
    nmse, nlpd, exact = (
        difference_by_push(first, second, figure) for figure in (total_nmse, total_nlpd, total_exact_nlpd)
    )
    return f"{nmse.text('+.3f')} | {nlpd.value:+.2f} | {exact.text('+.2f')}"


def measured_cases(data: Path | None) -> Iterator[tuple[str, list[Case]]]:
    """The measured square in five folds of pushes, by name; nothing without the data."""
    if data is not None:
        with tempfile.TemporaryDirectory() as work:
            square = imported_square(data, Path(work))
        yield "mit_square, by push", folds_of(square.table, square.rig)


def simulated_cases(bags: Path | None) -> Iterator[tuple[str, list[Case]]]:
    """The recordings of `bags/`, by name of what is tested on; nothing without them."""
    if bags is None:
        return
    training, rig = with_rig(bags / "square_abs_train")
    order = np.random.default_rng(0).permutation(len(training))
    yield "square_abs_test", [Case(training.take(order), with_rig(bags / "square_abs_test")[0], rig, 0)]
    for name in OWN_FOLDS:
        yield f"{name}, by push", folds_of(*with_rig(bags / name))


def folds_of(table: PushTable, rig: Rig) -> list[Case]:
    """Five folds of whole pushes, the training rows in the order in which they are drawn."""
    return [_case(table, rig, split_by_push(table, k), k) for k in range(FOLDS)]


def _case(table: PushTable, rig: Rig, split: Split, fold: int) -> Case:
    return Case(table.take(split.training), table.take(split.test), rig, fold)


def with_rig(path: Path) -> tuple[PushTable, Rig]:
    """A recording or push table, and its rig."""
    rig = load_rig_for([path])
    return load_data([path], rig), rig


if __name__ == "__main__":
    main()
