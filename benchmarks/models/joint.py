# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Gain from the correlation of the outputs: joint density against the product of the marginals of the same model.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.models.joint [--data FOLDER] [--bags FOLDER] [--model vhgp|gp] [--quick]

--data: the folder of the measured data with mit_square; split by push (5 folds) and at random (5 seeds). --bags: the
standard recordings of `simulate`; trained on square_abs_train, tested on square_abs_test. Prints the tables of
docs/results/covariance.md. Differences are paired; their intervals resample whole pushes.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from push_predictor_paper.fits.fit import SPLIT_WORDS, Fit, SplitName, split_of
from push_predictor_paper.fits.fit import trained as trained_on_split

from benchmarks.measured.square import SIZES, imported_square
from push_predictor.evaluation.estimate import Estimate, of_draws
from push_predictor.evaluation.metrics import joint_nlpd
from push_predictor.evaluation.push_scores import by_push
from push_predictor.evaluation.splits import FOLDS, push_bootstrap
from push_predictor.models.predictors import GaussianProcessPredictor
from push_predictor.models.predictors.correlation import Correlation, fit_correlation
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.load import load_data, load_rig_for
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

EVERYWHERE = 1e6  # a bandwidth at which all rows have the same weight
HEAD = (
    "| n | pushes | joint NLPD | product of marginals | joint minus product | 95 % | one correlation for all pushes "
    "minus product | 95 % | correlated | bandwidth, shrinkage | CPU s, of it correlation |\n" + 11 * "|---" + "|"
)


@dataclass(frozen=True, eq=False)
class Judged:
    """Negative log densities of n windows.

    nlpd (n, 3): with the model's correlation, with one correlation for all pushes, and with none. correlation: of the
    model. cpu: s of training, and of fitting the correlation.
    """

    push_id: np.ndarray
    nlpd: Array
    correlation: Correlation | None
    cpu: tuple[float, float]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="the folder of the measured data")
    parser.add_argument("--bags", type=Path, help="the folder of the simulated recordings")
    parser.add_argument("--model", choices=("vhgp", "gp"), default="vhgp")
    parser.add_argument("--quick", action="store_true", help="n = 100 only")
    options = parser.parse_args(arguments)
    sizes = SIZES[:1] if options.quick else SIZES
    if options.data:
        _measured(options.data, options.model, sizes)
    if options.bags:
        _simulated(options.bags, options.model, sizes)


def judged(model: PushModel, test: PushTable, cpu: float) -> Judged:
    """Score a learned model on windows that it was not trained on."""
    assert isinstance(model.predictor, GaussianProcessPredictor)
    start = time.process_time()
    correlation = fit_correlation(model.predictor.regressions, model.training.push_id)
    of_correlation = time.process_time() - start
    constant = replace(correlation, bandwidth=EVERYWHERE) if correlation else None
    columns = [_nlpd(model, kind, test) for kind in (correlation, constant, None)]
    return Judged(test.push_id, np.column_stack(columns), correlation, (cpu, of_correlation))


def pooled(parts: Sequence[Judged]) -> tuple[np.ndarray, Array, Array]:
    """Pushes (p,) of all parts, number of windows (p,) of each, and summed densities (p, 3)."""
    pushes, index = np.unique(np.concatenate([part.push_id for part in parts]), return_inverse=True)
    sums = by_push(index, np.concatenate([part.nlpd for part in parts]))
    return pushes, np.bincount(index).astype(np.float64), sums


def gain(pushes: np.ndarray, windows: Array, sums: Array) -> Estimate:
    """Mean per window of sums (p,) over pushes with `windows` (p,) each, with its interval."""
    weights = push_bootstrap(pushes)
    return of_draws(float(sums.sum() / windows.sum()), (weights @ sums) / (weights @ windows))


def _nlpd(model: PushModel, correlation: Correlation | None, test: PushTable) -> Array:
    assert isinstance(model.predictor, GaussianProcessPredictor)
    prediction = replace(model, predictor=replace(model.predictor, correlation=correlation)).predict_rows(
        test.inputs, test.duration
    )
    return joint_nlpd(prediction.mean, prediction.covariance, test.outcomes)


def _row(n: int, parts: Sequence[Judged]) -> str:
    pushes, windows, sums = pooled(parts)
    full, _, product = sums.sum(axis=0) / windows.sum()
    gains = (gain(pushes, windows, sums[:, k] - sums[:, 2]) for k in (0, 1))
    cells = " | ".join(f"{g.value:+.3f} | {g.low:+.3f} to {g.high:+.3f}" for g in gains)
    found = [part.correlation for part in parts if part.correlation]
    chosen = " ".join(f"{c.bandwidth:g},{c.shrinkage:g}" for c in found)
    training, fitting = np.mean([part.cpu for part in parts], axis=0)
    return (
        f"| {n} | {len(pushes)} | {full:.3f} | {product:.3f} | {cells} | {len(found)} of {len(parts)} | {chosen} | "
        f"{training:.2f}, {fitting:.2f} |"
    )


def _measured(data: Path, kind: str, sizes: Sequence[int]) -> None:
    with tempfile.TemporaryDirectory(prefix="joint_") as work:
        pushes = imported_square(data, Path(work))
    splits: tuple[SplitName, ...] = ("push", "random")
    for split in splits:

        def parts(n: int, split: SplitName = split) -> Iterator[Judged]:
            for k in range(FOLDS):
                fit, start = Fit(kind, n, split, k), time.process_time()
                model = trained_on_split(pushes, fit)
                yield judged(model, pushes.table.take(split_of(pushes, fit).test), time.process_time() - start)

        print(f"\nmit_square, {kind}, {SPLIT_WORDS[split]}\n\n{HEAD}")
        for n in sizes:
            print(_row(n, list(parts(n))), flush=True)


def _simulated(bags: Path, kind: str, sizes: Sequence[int]) -> None:
    paths = [bags / f"square_abs_{part}" for part in ("train", "test")]
    train, test = (load_data([path]) for path in paths)
    rig = load_rig_for(paths[:1])
    print(f"\nsimulated square on abs, {kind}, other pushes\n\n{HEAD}")
    for n in sizes:
        parts = []
        for seed in range(FOLDS):
            start = time.process_time()
            model = train_model(
                train, rig, kind, name=kind, options=TrainingOptions(n_train=n, seed=seed, tails=False, mean="zero")
            )
            parts.append(judged(model, test, time.process_time() - start))
        print(_row(n, parts), flush=True)


if __name__ == "__main__":
    main()
