# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The sparse VHGP next to GPflow's heteroskedastic SVGP on the measured square, and on many simulated windows.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.models.sparse [--data FOLDER] [--python PYTHON] [--folds 5]
        [--rows 100000]

With --data, FOLDER/mit_square: 2500 rows of the random split, and the training rows of each fold by push. Models:
sparse with 100 and 200 inducing inputs, dense with 1000 rows and, in the interpreter PYTHON, GPflow with 100 inducing
inputs and 200 steps. Then --rows windows of simulated pushes at three speeds (0 for none): CPU and wall seconds for
three outputs, peak memory so far, CPU ms for 1000 predictions, and NLPD on 1000 windows of other pushes, next to a
dense model of 1000.
"""

from __future__ import annotations

import argparse
import os
import resource
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.models.peers import (
    HEAD,
    Fitted,
    Rows,
    compare,
    each_output,
    elsewhere,
    scores,
    sparse,
    square_rows,
    standardised,
)
from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.features import push_features
from push_predictor.models.gaussian_process.sparse_vhgp import fit_sparse_vhgp
from push_predictor.models.gaussian_process.vhgp import fit_vhgp
from push_predictor.simulation.outcomes import push_outcomes
from push_predictor.simulation.pushes import random_pushes
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array

DENSE = 1000
HELD_OUT = 1000
SPEEDS = (0.01, 0.02, 0.05)
LENGTH = 0.025  # m of each simulated push
WINDOWS_A_PUSH = 6.0  # fewer than there are


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="folder that holds mit_square")
    parser.add_argument("--python", type=Path, help="an interpreter with gpflow")
    parser.add_argument("--steps", type=int, default=200, help="of GPflow's optimisers")
    parser.add_argument("--folds", type=int, default=1, help="by push, of 5")
    parser.add_argument("--rows", type=int, default=100_000, help="simulated windows")
    parser.add_argument("--inducing", type=int, nargs="*", default=[100, 200], help="of the simulated windows' models")
    options = parser.parse_args()
    print(f"load average {os.getloadavg()[0]:.1f}")
    if options.data:
        measured(options.data, options.python, options.steps, options.folds)
    if options.rows:
        simulated(options.rows, options.inducing)
    print(f"load average {os.getloadavg()[0]:.1f}")


def measured(data: Path, python: Path | None, steps: int, folds: int) -> None:
    """Print the measured square's table; times are relative to the sparse model with 100 inducing inputs."""
    print(HEAD.replace("/ VHGP", "/ first"))
    models = {f"sparse VHGP {m}": sparse(m) for m in (100, 200)} | {f"VHGP, {DENSE} rows": dense}
    if python is None:
        print("GPflow: not run, give --python")
    else:
        models["GPflow SVGP 100"] = elsewhere("gpflow", python, steps)
    for split in square_rows(data, folds):
        compare(split.rows(len(split.training)), models)


def dense(rows: Rows) -> Fitted:
    """Fit the dense VHGP to the first rows."""
    return each_output(fit_vhgp)(rows.first(DENSE))


def simulated(n: int, inducing: list[int]) -> None:
    """Print a line for the dense model, then one for each number of inducing inputs."""
    rows = simulated_rows(n)
    print(
        "\nsimulated                n  model                CPU s  wall s  peak MB  1000: ms    NMSE     NLPD   exact"
    )
    report(rows.first(DENSE), "VHGP", fit_vhgp)
    for m in inducing:
        report(rows, f"sparse VHGP {m}", partial(fit_sparse_vhgp, most_inducing=m))


def report(rows: Rows, name: str, fit: Callable[[Array, Array], Any]) -> None:
    """Train, predict, print."""
    cpu, wall = time.process_time(), time.perf_counter()
    models = [fit(rows.inputs, column) for column in rows.outputs.T]
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    start = time.process_time()
    predictions = [model.predict(rows.new[:1000]) for model in models]
    taken = 1e3 * (time.process_time() - start)
    figures = scores(rows, Fitted(predictions, cpu))
    print(
        f"{rows.title:20s} {len(rows.inputs):6d}  {name:18s} {cpu:7.1f} {wall:7.1f} {peak:8.0f} {taken:9.1f} {figures}"
    )


def simulated_rows(n: int) -> Rows:
    """Windows of random pushes of the square on ABS, in random order; the split keeps pushes whole."""
    start = time.process_time()
    plan = random_pushes(int(n / WINDOWS_A_PUSH) + HELD_OUT, SPEEDS, LENGTH)
    table = push_outcomes(SimulationSpec("rect1", "abs", plan, seed=1))
    print(f"{len(table)} windows of {len(plan)} simulated pushes in {time.process_time() - start:.0f} CPU s")
    rng = np.random.default_rng(0)
    pushes, push = np.unique(table.push_id, return_inverse=True)
    held = rng.permutation(len(pushes))[push] < 0.02 * len(pushes)
    training, test = (rng.permutation(np.flatnonzero(which)) for which in (~held, held))
    features = push_features(shape_outline("rect1"), table.inputs)
    return standardised("rect1, abs", features, table.outcomes, training[:n], test[:HELD_OUT])


if __name__ == "__main__":
    main()
