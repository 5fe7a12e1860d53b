# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A prior model before the first push and after few, next to GP and VHGP trained on the same pushes.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.models.prior --bags bags --data FOLDER --rigs 4 [--kinds prior gp vhgp]
        [--pushes 0 5 10 20 50]

--bags: the standard recordings of `simulate`; the square trains on square_abs_train, the other outlines on four of
five folds of their few pushes. --data: the folder of the measured data: mit_square is split by push in five folds, the
logs of mlab test the model before the first push, each on its own support. --rigs: so many rigs of each of the
simulators benchmarks/foreign and benchmarks/points_rig, before the first push. Training pushes are drawn at random, the
same for all models. The reference of the NMSE is the mean of all training pushes that could have been drawn, the same
for all models and n, or that of the test pushes where none can be drawn. Prints the tables of docs/results/prior.md,
and the coverage before the first push on average over rigs and on the worst.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.measured.informed import OWN_FOLDS, Case, with_rig
from benchmarks.measured.scores import WITHIN, within
from benchmarks.measured.square import imported_square
from benchmarks.models.rigs_at_speeds import session
from benchmarks.support.scripts import parser_of, ruled
from push_predictor.evaluation.estimate import by_push, total_exact_nlpd, total_nmse
from push_predictor.evaluation.push_scores import PushScores, pooled, push_scores
from push_predictor.evaluation.splits import FOLDS, push_folds
from push_predictor.evaluation.validation import compare
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.importers import import_source
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable, empty_table

PUSHES = (0, 5, 10, 20, 50)
SQUARE_TRAINING, SQUARE_TESTS = "square_abs_train", ("square_abs_test", "square_abs_repeats")
OTHER_PUSHES, OTHER_SPEED = 100, 0.02  # m/s: on rigs of other simulators
SEEDS = 3  # draws of training pushes for the square
HEAD = "| pushes | windows | model | NMSE (95 %) | exact NLPD (95 %) | within 95 % (dx dy dtheta) | CPU, s |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables as Markdown."""
    parser = parser_of(__doc__)
    parser.add_argument("--bags", type=Path, help="the folder of the simulated recordings")
    parser.add_argument("--data", type=Path, help="the folder of the measured data")
    parser.add_argument("--kinds", nargs="+", choices=("prior", "gp", "vhgp"), default=("prior", "gp", "vhgp"))
    parser.add_argument("--rigs", type=int, default=0, help="number of rigs of each other simulator")
    parser.add_argument("--pushes", nargs="+", type=int, default=PUSHES)
    options = parser.parse_args(arguments)
    before = {}
    for name, cases in (*_simulated(options.bags), *_measured(options.data), *_others(options.rigs)):
        print(f"\n{name}\n\n{ruled(HEAD)}")
        for n in options.pushes:
            if all(n <= len(case.training.pushes) for case in cases):
                scores = _rows(cases, n, options.kinds)
                if not n and scores is not None:
                    before[name] = float(scores.totals().coverage[0, :, WITHIN].mean())
    if before:
        worst = min(before, key=before.__getitem__)
        mean = np.mean(list(before.values()))
        print(f"\nBefore the first push, 95 % intervals cover {mean:.3f} on average over {len(before)} rigs,")
        print(f"and at least {before[worst]:.3f} ({worst}).")


def _rows(cases: Sequence[Case], n: int, kinds: Sequence[str]) -> PushScores | None:
    """Print a row for each kind; the scores of the prior model."""
    of_prior = None
    for kind in kinds:
        if n == 0 and kind != "prior":
            continue
        parts = [_scored(case, n, kind) for case in cases]
        windows = np.mean([windows for _, windows, _ in parts])
        cpu = np.mean([cpu for *_, cpu in parts])
        scores = pooled([scores for scores, *_ in parts])
        print(f"| {n} | {windows:.0f} | {kind} | {_cells(scores)} | {cpu:.1f} |", flush=True)
        of_prior = scores if kind == "prior" else of_prior
    return of_prior


def _cells(scores: PushScores) -> str:
    nmse, nlpd = by_push(scores, total_nmse), by_push(scores, total_exact_nlpd)
    return f"{nmse.text('.3f')} | {nlpd.text('.2f')} | {within(scores)}"


def _scored(case: Case, n: int, kind: str) -> tuple[PushScores, int, float]:
    """Scores of a model of n pushes, the number of its windows, and CPU s of training."""
    names = np.random.default_rng(case.seed).permutation(np.array(sorted(case.training.pushes)))[:n]
    rows = case.training.take(np.isin(case.training.push_id, names)) if n else empty_table()
    start = time.process_time()
    model = train_model(
        rows, case.rig, kind, name=kind, options=TrainingOptions(seed=case.seed, mean="zero", tails=False)
    )
    cpu = time.process_time() - start
    reference = (case.training if len(case.training) else case.test).outcomes.mean(axis=0)
    comparison = replace(compare(model, case.test), training_mean=reference)
    return push_scores(comparison), len(model.training), cpu


def _simulated(bags: Path | None) -> Iterator[tuple[str, list[Case]]]:
    if bags is None:
        return
    loaded = {name: with_rig(bags / name) for name in (SQUARE_TRAINING, *SQUARE_TESTS, *OWN_FOLDS)}
    training, rig = loaded[SQUARE_TRAINING]
    for name in SQUARE_TESTS:
        yield name, [Case(training, loaded[name][0], rig, seed) for seed in range(SEEDS)]
    for name in OWN_FOLDS:
        yield name, _folds(*loaded[name])


def _measured(data: Path | None) -> Iterator[tuple[str, list[Case]]]:
    if data is None:
        return
    with tempfile.TemporaryDirectory() as work:
        square = imported_square(data, Path(work))
    yield "mit_square", _folds(square.table, square.rig)
    with tempfile.TemporaryDirectory() as work:
        import_source("mlab", [data / "mlab" / "sensor_log"], Path(work))
        logs = {path.stem: with_rig(path) for path in sorted(Path(work).glob("*.csv"))}
    for name, (table, rig) in logs.items():
        yield f"mlab {name}", [Case(empty_table(), table, rig, 0)]


def _others(count: int) -> Iterator[tuple[str, list[Case]]]:
    with tempfile.TemporaryDirectory() as work:
        for simulator in ("foreign", "points"):
            for number in range(count):
                table, rig = session(simulator, number, 0, OTHER_PUSHES, (OTHER_SPEED,), Path(work))
                yield f"{simulator} {number}", [Case(empty_table(), table, rig, 0)]


def _folds(table: PushTable, rig: Rig) -> list[Case]:
    fold = push_folds(table)
    return [Case(table.take(fold != k), table.take(fold == k), rig, k) for k in range(FOLDS)]


if __name__ == "__main__":
    main()
