# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Coverage of the intervals for new pushes, without and with tails: docs/results/accuracy.md.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.models.intervals [--data FOLDER] [--bags bags] [--sets]
        [--sizes N ...] [--means mechanics zero] [--kind vhgp]

--data and --bags: as in benchmarks/measured/informed.py; a size beyond the training windows of a recording takes all.
--sets: the 16 pairs of shape and surface of the paper, simulated, in two of five folds of pushes, and all together.
"gaussian" is the model without tails, "student" and "conformal" are the intervals with. The last column has paired
differences of the exact NLPD from the model without tails. All intervals resample whole pushes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from push_predictor_paper.data.corpus import learning_set
from push_predictor_paper.plan import FULL

from benchmarks.measured.informed import Case, measured_cases, simulated_cases, trained
from benchmarks.support.scripts import parser_of, ruled
from push_predictor.errors import RequestError
from push_predictor.evaluation.estimate import by_push, difference_by_push, of_draws, total_exact_nlpd
from push_predictor.evaluation.metrics import COVERAGE_LEVELS, standardised
from push_predictor.evaluation.push_scores import PushScores, pooled, push_scores
from push_predictor.evaluation.splits import push_bootstrap, split_by_push
from push_predictor.evaluation.validation import Comparison, compare
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.predictors.tails import joint_radius
from push_predictor.types import Array

SIZES = (100, 200, 500, 1000)
MEANS = ("mechanics", "zero")
LEVEL = 0.95
SETS = replace(FULL, pushes=240, reference_pushes=240)
SET_FOLDS = 2  # of five: 96 test pushes of each pair
HEAD = (
    "| n (pushes) | mean | intervals | 50 %: dx dy dtheta | 90 % | 95 % | joint 95 % | exact NLPD (95 %) | difference |"
)


@dataclass(frozen=True, eq=False)
class Found:
    """Held-out windows of all folds without and with tails; pushes: number of training pushes of the first fold."""

    before: list[Comparison]
    after: list[Comparison]
    rows: int
    pushes: int


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables as Markdown."""
    parser = parser_of(__doc__)
    parser.add_argument("--data", type=Path, help="the folder of the measured data")
    parser.add_argument("--bags", type=Path, help="the folder of the simulated recordings")
    parser.add_argument("--sets", action="store_true", help="the simulated pairs of shape and surface")
    parser.add_argument("--sizes", nargs="+", type=int, default=SIZES)
    parser.add_argument("--means", nargs="+", default=MEANS)
    parser.add_argument("--kind", default="vhgp", choices=("vhgp", "gp"))
    options = parser.parse_args(arguments)
    for name, cases in (*measured_cases(options.data), *simulated_cases(options.bags)):
        print_cases(name, cases, options)
    if options.sets:
        each = [print_cases(name, cases, options) for name, cases in set_cases()]
        print(f"\nall {len(each)} pairs together\n\n{ruled(HEAD)}")
        for mean, tables in zip(options.means, zip(*each, strict=True), strict=True):
            for of_size in zip(*tables, strict=True):
                print_rows(_together(of_size), mean)


def print_cases(name: str, cases: Sequence[Case], options: argparse.Namespace) -> list[list[Found]]:
    """Print the table of some cases; return what was found by mean and size."""
    held = [case.test for case in cases]
    pushes = sum(len(table.pushes) for table in held)
    print(f"\n{name}: {sum(map(len, held))} held-out windows of {pushes} pushes\n\n{ruled(HEAD)}")
    most = min(len(case.training) for case in cases)
    every = []
    for mean in options.means:
        every.append([found(cases, n, options.kind, mean) for n in sorted({min(n, most) for n in options.sizes})])
        for of_size in every[-1]:
            print_rows(of_size, mean)
    return every


def set_cases() -> Iterator[tuple[str, list[Case]]]:
    """The 16 simulated pairs of shape and surface, folds of each, by name."""
    for shape, surface in SETS.pairs:
        pushes = learning_set(SETS, shape, surface)
        folds = [split_by_push(pushes.table, fold) for fold in range(SET_FOLDS)]
        table = replace(pushes.table, push_id=np.char.add(f"{shape} {surface} ", pushes.table.push_id))
        yield (
            f"{shape} on {surface}",
            [Case(table.take(s.training), table.take(s.test), pushes.rig, k) for k, s in enumerate(folds)],
        )


def found(cases: Sequence[Case], n: int, kind: str, mean: str) -> Found:
    """Train on n windows of each case, and predict its test windows without and with tails."""
    before, after, pushes = [], [], []
    for case in cases:
        model, _ = trained(case, n, kind, mean, tails=True)
        assert isinstance(model.predictor, GaussianProcessPredictor)
        after.append(compare(model, case.test))
        before.append(compare(replace(model, predictor=replace(model.predictor, tails=None)), case.test))
        pushes.append(len(model.training.pushes))
    return Found(before, after, n, pushes[0])


def _together(found: Sequence[Found]) -> Found:
    before, after = ([c for one in found for c in getattr(one, name)] for name in ("before", "after"))
    return Found(before, after, found[0].rows, found[0].pushes)


def print_rows(found: Found, mean: str) -> None:
    """Print the rows of a size and mean."""
    before, after = (pooled([push_scores(c) for c in comparisons]) for comparisons in (found.before, found.after))
    head = f"| {found.rows} ({found.pushes}) | {mean}"
    nlpd = by_push(before, total_exact_nlpd).text(".2f")
    print(f"{head} | gaussian | {_shares(before)} | {_joint(found.before)} | {nlpd} | |")
    nlpd = by_push(after, total_exact_nlpd).text(".2f")
    change = difference_by_push(before, after, total_exact_nlpd).text("+.3f")
    print(f"{head} | student | {_shares(after)} | {_joint(found.after)} | {nlpd} | {change} |")
    print(f"{head} | conformal | {_conformal(found.after)} | | | |", flush=True)


def _shares(scores: PushScores) -> str:
    """Coverage of the three outputs at each level, and the widest half of a 95 % interval."""
    shares, draws = scores.totals().coverage[0], scores.resampled().coverage
    return " | ".join(_cell(shares[:, k], draws[..., k]) for k in range(len(COVERAGE_LEVELS)))


def _cell(shares: Array, draws: Array) -> str:
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    return f"{' '.join(f'{share:.3f}' for share in shares)} (±{float(np.max(high - low)) / 2.0:.3f})"


def _conformal(comparisons: Sequence[Comparison]) -> str:
    cells = []
    for level in COVERAGE_LEVELS:
        try:
            inside = np.concatenate([c.covered([level], "conformal")[..., 0] for c in comparisons])
        except RequestError:  # too few training pushes for this level
            cells.append("–")
            continue
        cells.append(" ".join(f"{share:.3f}" for share in inside.mean(axis=0)))
    return " | ".join(cells)


def _joint(comparisons: Sequence[Comparison]) -> str:
    """Coverage of the joint region, with its 95 % interval."""
    parts = [np.linalg.norm(standardised(c.mean, c.covariance, c.observed), axis=1) for c in comparisons]
    inside = np.concatenate(
        [away <= joint_radius(c.tails, LEVEL) for away, c in zip(parts, comparisons, strict=True)]
    ).astype(np.float64)
    weights = push_bootstrap(np.concatenate([c.push_id for c in comparisons]))
    return of_draws(float(inside.mean()), (weights @ inside) / weights.sum(axis=1)).text(".3f")


if __name__ == "__main__":
    main()
