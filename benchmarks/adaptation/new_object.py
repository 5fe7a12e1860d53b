# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A new object: a prior model, ten pushes, and the prior adapted by them, next to a GP of 200 pushes.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.adaptation.new_object [--data FOLDER]

On the twenty simulated pools of benchmarks/models/active.py, and with --data on the five folds of mit_square. The ten
pushes are drawn at random, the same for the adapted model and for one trained on them by `train --kind prior`. The GP
has no mechanics; mit_square has 89 pushes, so that there it gets all of four folds. Each window of the pools counts the
same; the reference of the NMSE is the mean of a pool. Intervals come from resampling whole pushes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.adaptation.results import coverage
from benchmarks.models.active import Case, cases_of
from push_predictor.adaptation import Adaptation
from push_predictor.evaluation.estimate import by_push, total_exact_nlpd, total_nmse
from push_predictor.evaluation.push_scores import PushScores, pooled, push_scores
from push_predictor.evaluation.validation import compare
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import empty_table

POOLS = (
    "rect1:abs:21 ellip1:plywood:26 hex:pu:31 ellip2:delrin:36 ellip3:abs:37 rect1:plywood:22 ellip1:pu:27 "
    "hex:delrin:32 ellip2:abs:33 ellip3:plywood:38 rect1:pu:23 ellip1:delrin:28 hex:abs:29 ellip2:plywood:34 "
    "ellip3:pu:39 rect1:delrin:24 ellip1:abs:25 hex:plywood:30 ellip2:pu:35 ellip3:delrin:40"
)
FEW, MANY = 10, 200


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="the folder of the measured data")
    options = parser.parse_args()
    found: dict[tuple[str, str], list[PushScores]] = {}
    for case in cases_of(options.data, POOLS.split()):
        for name, model in _models(case):
            scores = _scores(case, model)
            found.setdefault((case.kind, name), []).append(scores)
            print(f"{case.name:16} {name:24} {_cells(scores)}", flush=True)
    print("\n| pushes of | model | NMSE | exact NLPD | in 95 % |\n|" + 5 * " --- |")
    for (kind, name), parts in found.items():
        print(f"| {kind} | {name} | {_cells(pooled(parts))} |")


def _models(case: Case) -> Iterator[tuple[str, PushModel]]:
    names = np.random.default_rng([0, *case.name.encode()]).permutation(np.array(case.pool.pushes))
    few, many = (case.pool.take(np.isin(case.pool.push_id, names[:count])) for count in (FEW, MANY))
    prior = train_model(empty_table(), case.rig, "prior", name="prior")
    yield "prior", prior
    adaptation = Adaptation(prior)
    for push in few.pushes:
        adaptation.update(few.take(few.push_id == push))
    yield f"prior adapted by {FEW}", adaptation.adapted
    yield f"prior trained on {FEW}", train_model(few, case.rig, "prior", name="prior")
    yield f"GP of {MANY}", train_model(many, case.rig, "gp", name="gp", options=TrainingOptions(mean="zero"))


def _scores(case: Case, model: PushModel) -> PushScores:
    comparison = replace(compare(model, case.test), training_mean=case.pool.outcomes.mean(axis=0))
    return push_scores(replace(comparison, push_id=np.char.add(f"{case.name}/", comparison.push_id)))


def _cells(scores: PushScores) -> str:
    nmse, nlpd = by_push(scores, total_nmse), by_push(scores, total_exact_nlpd)
    return f"{nmse.text('.3f')} | {nlpd.text('.2f')} | " + " ".join(f"{c:.2f}" for c in coverage(scores))


if __name__ == "__main__":
    main()
