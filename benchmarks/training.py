"""Training cost of GP and VHGP against scikit-learn's GP, all measured in this run on rows made up here.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.training [n ...]

CPU seconds for three outputs of two inputs, and ratios to scikit-learn's homoscedastic GP; below them the time
to rebuild three VHGPs from their parameters and to predict one input and a thousand.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from push_predictor.models.gp import fit_gp
from push_predictor.models.vhgp import VHGP, fit_vhgp
from push_predictor.types import Array


def main(sizes: list[int]) -> None:
    """Print one line of costs per training size."""
    print("    n   sklearn GP        GP      VHGP   [CPU s]   GP/sklearn  VHGP/sklearn  rebuild ms   1 us  1000 ms")
    for n in sizes:
        inputs, outputs = made_up_pushes(n)
        reference, _ = cpu_seconds(lambda x=inputs, y=outputs: [fit_reference(x, column) for column in y.T])
        gp, processes = cpu_seconds(lambda x=inputs, y=outputs: [fit_gp(x, column) for column in y.T])
        vhgp, models = cpu_seconds(lambda p=processes: [fit_vhgp(gp.inputs, gp.outputs, gp) for gp in p])
        vhgp += gp
        rebuild = fastest(lambda m=models: [VHGP(v.inputs, v.outputs, v.parameters, v.site_precisions) for v in m])
        new, _ = made_up_pushes(1000, seed=1)
        one = fastest(lambda m=models, x=new: [v.predict(x[:1]) for v in m], repeats=50)
        many = fastest(lambda m=models, x=new: [v.predict(x) for v in m])
        print(
            f"{n:5d} {reference:12.2f} {gp:9.2f} {vhgp:9.2f} {gp / reference:21.2f} {vhgp / reference:13.2f}"
            f" {1e3 * rebuild:11.0f} {1e6 * one:6.0f} {1e3 * many:8.0f}"
        )


def made_up_pushes(n: int, seed: int = 0) -> tuple[Array, Array]:
    """Standardised inputs (n, 2) and outputs (n, 3) that look like pushes of one edge, noisy where they slide."""
    rng = np.random.default_rng(seed)
    inputs = rng.uniform(-1.7, 1.7, size=(n, 2))
    lever, angle = inputs.T
    mean = np.column_stack([np.cos(angle) - 0.3 * lever**2, np.sin(angle), lever * np.cos(angle)])
    noise = 0.05 + 0.5 / (1.0 + np.exp(-6.0 * (np.abs(angle) - 1.0)))
    return inputs, mean + noise[:, None] * rng.normal(size=(n, 3))


def fit_reference(inputs: Array, outputs: Array) -> GaussianProcessRegressor:
    """scikit-learn's GP with the kernel of ours."""
    return GaussianProcessRegressor(ConstantKernel() * RBF([1.0, 1.0]) + WhiteKernel(0.1)).fit(inputs, outputs)


def cpu_seconds(work: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds of this process for one run of `work`, and what it returned."""
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def fastest(work: Callable[[], Any], repeats: int = 5) -> float:
    """Shortest wall time of several runs, s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


if __name__ == "__main__":
    main([int(argument) for argument in sys.argv[1:]] or [100, 200, 500, 1000])
