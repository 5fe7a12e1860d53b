# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Training cost of GP and VHGP relative to scikit-learn's GP, on the same rows in one run.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.models.training [n ...] [--data FOLDER]

Rows are made up, with two inputs and with three, and those of simulated pushes with the speed as an input: three slow
speeds, and the ten of the paper. With --data also those of FOLDER/mit_square. CPU seconds for three outputs, ratios to
scikit-learn's homoscedastic GP, and the peak memory of one fit in dense matrices of n x n doubles. Last: the time to
rebuild three VHGPs from their parameters, and to predict one input and a thousand.
"""

from __future__ import annotations

import argparse
import time
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.features import push_features
from push_predictor.models.gaussian_process.gp import fit_gp
from push_predictor.models.gaussian_process.vhgp import VHGP, fit_vhgp
from push_predictor.simulation.outcomes import push_outcomes
from push_predictor.simulation.pushes import random_pushes
from push_predictor.simulation.spec import SimulationSpec
from push_predictor.types import Array

SLOW = (0.01, 0.02, 0.05)  # m/s
ALL_SPEEDS = (0.01, 0.02, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5)  # m/s, those of the paper
WINDOW, WINDOWS = 0.2, 2  # s; of a push at least
BEFORE = 0.025  # m: to accelerate and decelerate
SHORTEST_PUSH, LONGEST_PUSH = 0.02, 0.2  # m: travel of slow pushes, and of the fastest, which have one window


def main() -> None:
    """Print one line of costs for each set of rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sizes", nargs="*", type=int, default=[100, 200, 500, 1000])
    parser.add_argument("--data", type=Path, help="folder that holds mit_square")
    arguments = parser.parse_args()
    print("                 CPU s                   / sklearn    matrices  ms         us      ms")
    print("rows          n  sklearn    GP   VHGP    GP   VHGP    peak      rebuild  1 push  1000")
    for n in arguments.sizes:
        for title, inputs, outputs in rows(n, arguments.data):
            reference, _ = cpu_seconds(partial(fit_references, inputs, outputs))
            print(f"{title:10s} {len(inputs):5d} {costs(inputs, outputs, reference)}", flush=True)


def rows(n: int, data: Path | None) -> Iterator[tuple[str, Array, Array]]:
    """Titles, standardised inputs (n, D) and outputs (n, 3)."""
    yield "made up 2", *made_up_pushes(n)
    yield "made up 3", *made_up_pushes(n, velocity=True)
    yield "3 speeds", *simulated_pushes(n, SLOW)
    yield "10 speeds", *simulated_pushes(n, ALL_SPEEDS)
    if data is not None:
        yield "mit_square", *measured_pushes(data / "mit_square" / "pushes_3500.npz", n)


def costs(inputs: Array, outputs: Array, reference: float) -> str:
    """One line of the table; reference: CPU seconds of scikit-learn's fits."""
    gp, processes = cpu_seconds(lambda: [fit_gp(inputs, column) for column in outputs.T])
    starts = [(process.outputs, process.parameters) for process in processes]
    vhgp, models = cpu_seconds(lambda: [fit_vhgp(inputs, column, start=start) for column, start in starts])
    vhgp += gp
    peak = peak_bytes(lambda: fit_vhgp(inputs, outputs[:, 0])) / (8.0 * len(inputs) ** 2)
    rebuild = fastest(lambda: [VHGP(v.inputs, v.outputs, v.parameters, v.site_precisions) for v in models])
    new = np.random.default_rng(1).uniform(-1.7, 1.7, size=(1000, inputs.shape[1]))
    one = fastest(lambda: [v.predict(new[:1]) for v in models], repeats=50)
    many = fastest(lambda: [v.predict(new) for v in models])
    return (
        f"{reference:8.2f} {gp:6.2f} {vhgp:6.2f} {gp / reference:5.2f} {vhgp / reference:6.2f} {peak:7.1f}"
        f" {1e3 * rebuild:12.0f} {1e6 * one:7.0f} {1e3 * many:5.0f}"
    )


def made_up_pushes(n: int, seed: int = 0, velocity: bool = False) -> tuple[Array, Array]:
    """Standardised inputs (n, 2) and outputs (n, 3) that look like pushes of one edge, noisy where they slide.

    velocity: a third input, over which the object slides further.
    """
    rng = np.random.default_rng(seed)
    inputs = rng.uniform(-1.7, 1.7, size=(n, 2))
    lever, angle = inputs.T
    mean = np.column_stack([np.cos(angle) - 0.3 * lever**2, np.sin(angle), lever * np.cos(angle)])
    noise = 0.05 + 0.5 / (1.0 + np.exp(-6.0 * (np.abs(angle) - 1.0)))
    if velocity:
        inputs = np.column_stack([rng.uniform(-1.7, 1.7, size=n), inputs])
        mean *= 1.0 + 0.3 * np.tanh(inputs[:, :1])
        noise *= np.exp(0.4 * inputs[:, 0])
    return inputs, mean + noise[:, None] * rng.normal(size=(n, 3))


def simulated_pushes(n: int, speeds: Sequence[float], seed: int = 1) -> tuple[Array, Array]:
    """Standardised inputs (n, 3) and outputs (n, 3): windows of the square on ABS at these speeds, m/s."""
    plan = random_pushes(n // 2 + n // 10 + 10, speeds, rng=np.random.default_rng(seed))
    travel = np.clip(WINDOWS * WINDOW * plan.speed + BEFORE, SHORTEST_PUSH, LONGEST_PUSH)
    table = push_outcomes(SimulationSpec("rect1", "abs", replace(plan, travel=travel), seed=seed), WINDOW)
    chosen = np.random.default_rng(0).permutation(len(table))[:n]
    features = push_features(shape_outline("rect1"), table.inputs)
    return _standardised(features[chosen]), _standardised(table.outcomes[chosen])


def measured_pushes(path: Path, n: int) -> tuple[Array, Array]:
    """Standardised inputs (n, 2) and outputs (n, 3) of random rows of the measured square."""
    with np.load(path) as file:
        chosen = np.random.default_rng(0).permutation(len(file["c"]))[:n]
        inputs, outputs = (
            np.column_stack([file[k][chosen] for k in keys]) for keys in (("c", "beta"), ("dx", "dy", "dtheta"))
        )
    return _standardised(inputs), _standardised(outputs)


def _standardised(columns: Array) -> Array:
    return np.asarray((columns - columns.mean(axis=0)) / columns.std(axis=0))


def fit_reference(inputs: Array, outputs: Array) -> GaussianProcessRegressor:
    """scikit-learn's GP with the squared exponential of ours."""
    return GaussianProcessRegressor(ConstantKernel() * RBF(np.ones(inputs.shape[1])) + WhiteKernel(0.1)).fit(
        inputs, outputs
    )


def fit_references(inputs: Array, outputs: Array) -> list[GaussianProcessRegressor]:
    """scikit-learn's GP for each output (columns)."""
    return [fit_reference(inputs, column) for column in outputs.T]


def cpu_seconds(work: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds of this process for one run of `work`, and what it returned."""
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def peak_bytes(work: Callable[[], Any]) -> int:
    """Peak memory of `work` beyond the memory in use before, bytes; includes numpy's arrays."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def fastest(work: Callable[[], Any], repeats: int = 5) -> float:
    """Shortest wall time of several runs, s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


if __name__ == "__main__":
    main()
