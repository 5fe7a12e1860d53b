# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Scores of models on pushes that they have not seen: the tables of docs/results/accuracy.md and prior.md.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.models.accuracy --cases NAME ... [--data FOLDER] [--models NAME ...]
        [--windows N ... | --pushes N ...]

--windows draws so many training windows, --pushes all windows of so many training pushes, the same for all models; by
default a model learns from all. Only a prior is asked before the first push. NMSE and NLPD are sums over the outputs;
the NMSE refers to the mean of all windows that could have been drawn. Intervals (95 %) resample whole pushes.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.models.cases import MEASURED, SIMULATED, Case, in_temporary_folder
from benchmarks.support.scripts import parser_of, piped, ruled
from push_predictor.errors import RequestError
from push_predictor.evaluation.estimate import by_push, total_exact_nlpd, total_nlpd, total_nmse
from push_predictor.evaluation.metrics import COVERAGE_LEVELS
from push_predictor.evaluation.push_scores import pooled, push_scores
from push_predictor.evaluation.validation import Comparison, compare
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable, empty_table

PLAIN = TrainingOptions(mean="zero", per_path=False, tails=False)  # as in Bauza and Rodriguez 2017
MODELS = {
    "textbook": ("analytical", TrainingOptions()),
    "fitted": ("analytical", TrainingOptions(fit=True)),
    "prior": ("prior", TrainingOptions()),
    "gp-plain": ("gp", PLAIN),
    "vhgp-plain": ("vhgp", PLAIN),
    "gp": ("gp", TrainingOptions()),
    "vhgp-zero": ("vhgp", TrainingOptions(mean="zero")),
    "vhgp-mechanics": ("vhgp", TrainingOptions(mean="mechanics")),
    "vhgp": ("vhgp", TrainingOptions()),
}
LEVEL = 0.95
Amount = tuple[str, "int | None"]  # windows or pushes, and how many; None: all
HEAD = (
    "| training | model | NMSE (95 %) | NLPD (95 %) | exact NLPD (95 %) | 50 %: dx dy dtheta | 90 % | 95 % "
    "| joint 95 % | conformal 95 % |"
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a table for each set of cases, as Markdown."""
    options = _options(arguments)
    amounts: list[Amount] = [("windows", n) for n in options.windows] + [("pushes", n) for n in options.pushes]
    for title, cases in in_temporary_folder(options.cases, options.data).items():
        pushes = {push for case in cases for push in case.test.pushes}
        print(f"\n{title}: {sum(len(case.test) for case in cases)} windows of {len(pushes)} pushes\n\n{ruled(HEAD)}")
        for amount in amounts or [("windows", None)]:
            for name in options.models:
                if all(_possible(case, amount, name) for case in cases):
                    found = [compared(case, drawn(case, amount), name) for case in cases]
                    print(piped([_words(amount), name, *cells(found)]), flush=True)


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = parser_of(__doc__)
    parser.add_argument("--cases", nargs="+", choices=(*MEASURED, *SIMULATED), required=True)
    parser.add_argument("--data", type=Path, help="the folder of the measured data")
    parser.add_argument("--models", nargs="+", choices=tuple(MODELS), default=("textbook", "gp-plain", "vhgp"))
    parser.add_argument("--windows", nargs="+", type=int, default=[])
    parser.add_argument("--pushes", nargs="+", type=int, default=[])
    return parser.parse_args(arguments)


def _possible(case: Case, amount: Amount, model: str) -> bool:
    """Whether the case has so many windows or pushes; without any, only a prior can be asked."""
    unit, n = amount
    held = len(case.training.pushes) if unit == "pushes" else len(case.training)
    return model == "prior" if n == 0 else 0 < (n or 1) <= held


def _words(amount: Amount) -> str:
    return "all" if amount[1] is None else f"{amount[1]} {amount[0]}"


def drawn(case: Case, amount: Amount) -> PushTable:
    """Training rows of a case: the first so many, or those of so many random pushes."""
    unit, n = amount
    if n == 0:
        return empty_table()
    if unit == "windows":
        return case.training.take(np.arange(n or len(case.training)))
    names = np.random.default_rng(case.seed).permutation(np.array(sorted(case.training.pushes)))[:n]
    return case.training.take(np.isin(case.training.push_id, names))


def compared(case: Case, table: PushTable, model: str) -> Comparison:
    """Train a model on a table and predict the test windows of a case."""
    reference = (case.training if len(case.training) else case.test).outcomes.mean(axis=0)
    return replace(compare(model_of(case, table, model), case.test), training_mean=reference)


def model_of(case: Case, table: PushTable, model: str) -> PushModel:
    """A model of a table; of more than 1000 rows, `train` draws as many evenly over the pushes."""
    kind, options = MODELS[model]
    return train_model(table, case.rig, kind, name=model, options=replace(options, seed=case.seed))


def cells(found: Sequence[Comparison]) -> list[str]:
    """The cells under HEAD of one model of every case, after the first two."""
    scores = pooled([push_scores(comparison) for comparison in found])
    figures = ((total_nmse, ".3f"), (total_nlpd, ".2f"), (total_exact_nlpd, ".2f"))
    covered = scores.totals().coverage[0]
    joint = np.concatenate([comparison.joint_covered([LEVEL]) for comparison in found])
    return [
        *(by_push(scores, figure).text(form) for figure, form in figures),
        *(" ".join(f"{share:.2f}" for share in covered[:, k]) for k in range(len(COVERAGE_LEVELS))),
        f"{joint.mean():.3f}",
        _conformal(found),
    ]


def _conformal(found: Sequence[Comparison]) -> str:
    try:
        inside = np.concatenate([comparison.covered([LEVEL], "conformal")[..., 0] for comparison in found])
    except RequestError:  # no tails, or too few training pushes for this level
        return "–"
    return " ".join(f"{share:.2f}" for share in inside.mean(axis=0))


if __name__ == "__main__":
    main()
