# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The dense VHGP next to the sparse one on the same rows of the measured square, by push, with intervals over pushes.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.models.dense_or_sparse --data FOLDER [--rows 2000] [--folds 5]

Each fold of whole pushes of FOLDER/mit_square is predicted by models of --rows rows of the other pushes. NMSE and exact
NLPD (SI) are sums over three outputs. The intervals of the difference, dense less sparse, are 95 % of bootstrap
samples of whole test pushes.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.models.peers import Measured, square_rows
from benchmarks.models.training import cpu_seconds
from push_predictor.evaluation.splits import push_bootstrap
from push_predictor.models.gaussian_process.prediction import exact_log_density
from push_predictor.models.gaussian_process.sparse_vhgp import fit_sparse_vhgp
from push_predictor.models.gaussian_process.vhgp import fit_vhgp
from push_predictor.types import Array

MODELS: dict[str, Callable[[Array, Array], Any]] = {"dense": fit_vhgp, "sparse": fit_sparse_vhgp}


def main() -> None:
    """Print a line for each fold and model, then the differences over all folds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder that holds mit_square")
    parser.add_argument("--rows", type=int, default=2000, help="training rows")
    parser.add_argument("--folds", type=int, default=5, help="by push, of 5")
    options = parser.parse_args()
    losses: dict[str, list[Array]] = {name: [] for name in MODELS}
    pushes = []
    for split in square_rows(options.data, options.folds)[1:]:
        pushes.append(split.table.push_id[split.test])
        for name, fit in MODELS.items():
            seconds, found = cpu_seconds(partial(row_losses, split, options.rows, fit))
            losses[name].append(found)
            error, density = found.mean(axis=0)
            print(
                f"{split.title:20s} {name:8s} {seconds:6.1f} s  NMSE {error:.4f}  exact NLPD {density:.3f}", flush=True
            )
    report({name: np.concatenate(found) for name, found in losses.items()}, np.concatenate(pushes))


def row_losses(split: Measured, n: int, fit: Callable[[Array, Array], Any]) -> Array:
    """Relative squared error and minus the exact log density of each test row (m, 2), summed over the outputs."""
    rows = split.rows(n)
    error, density = np.zeros(len(rows.new)), np.full(len(rows.new), np.log(rows.sd).sum())
    for column, truth, scale in zip(rows.outputs.T, rows.truth.T, rows.mean_error, strict=True):
        prediction = fit(rows.inputs, column).predict(rows.new)
        error += (prediction.mean - truth) ** 2 / scale
        density -= exact_log_density(prediction, truth)
    return np.column_stack([error, density])


def report(losses: dict[str, Array], push_id: np.ndarray) -> None:
    """Print each model's mean losses, and their differences with intervals over whole pushes."""
    for name, found in losses.items():
        error, density = found.mean(axis=0)
        print(f"all folds            {name:8s}           NMSE {error:.4f}  exact NLPD {density:.3f}")
    weights = push_bootstrap(push_id)
    difference = losses["dense"] - losses["sparse"]
    low, high = np.percentile((weights @ difference) / weights.sum(axis=1, keepdims=True), [2.5, 97.5], axis=0)
    for k, title in enumerate(("NMSE", "exact NLPD")):
        mean = difference[:, k].mean()
        count = f"{len(np.unique(push_id))} pushes"
        print(f"dense less sparse: {title} {mean:+.4f} (95 % CI {low[k]:+.4f} to {high[k]:+.4f}, {count})")


if __name__ == "__main__":
    main()
