"""Coverage of the intervals for new pushes, without and with tails: docs/results/intervals.md.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.models.intervals --data FOLDER [--bags bags] [--sizes N ...]
        [--means mechanics zero] [--kind vhgp]

--data and --bags: as in benchmarks/measured/informed.py; a size beyond the training windows of a recording takes all.
"gaussian" is the model without tails, "student" and "conformal" are the intervals with. The last column has paired
differences of the exact NLPD from the model without tails. All intervals resample whole pushes.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.measured.informed import Case, measured_cases, simulated_cases, trained
from push_predictor.errors import RequestError
from push_predictor.evaluation.estimate import by_push, difference_by_push, of_draws, total_exact_nlpd
from push_predictor.evaluation.metrics import COVERAGE_LEVELS, standardised
from push_predictor.evaluation.push_scores import PushScores, pooled, push_scores
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.evaluation.validation import Comparison, compare
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.predictors.tails import joint_radius
from push_predictor.types import Array

SIZES = (100, 200, 500, 1000)
MEANS = ("mechanics", "zero")
LEVEL = 0.95
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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="the folder of the measured data")
    parser.add_argument("--bags", type=Path, help="the folder of the simulated recordings")
    parser.add_argument("--sizes", nargs="+", type=int, default=SIZES)
    parser.add_argument("--means", nargs="+", default=MEANS)
    parser.add_argument("--kind", default="vhgp", choices=("vhgp", "gp"))
    options = parser.parse_args(arguments)
    for name, cases in (*measured_cases(options.data), *simulated_cases(options.bags)):
        held = [case.test for case in cases]
        pushes = sum(len(table.pushes) for table in held)
        print(f"\n{name}: {sum(map(len, held))} held-out windows of {pushes} pushes\n\n{HEAD}\n{9 * '|---'}|")
        most = min(len(case.training) for case in cases)
        for n in sorted({min(n, most) for n in options.sizes}):
            for mean in options.means:
                print_rows(found(cases, n, options.kind, mean), mean)


def found(cases: Sequence[Case], n: int, kind: str, mean: str) -> Found:
    """Train on n windows of each case, and predict its test windows without and with tails."""
    before, after, pushes = [], [], []
    for case in cases:
        model, _ = trained(case, n, kind, mean)
        assert isinstance(model.predictor, GaussianProcessPredictor)
        after.append(compare(model, case.test))
        before.append(compare(replace(model, predictor=replace(model.predictor, tails=None)), case.test))
        pushes.append(len(model.training.pushes))
    return Found(before, after, n, pushes[0])


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
