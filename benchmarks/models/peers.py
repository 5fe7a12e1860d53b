"""Training cost and quality next to other libraries, on the same rows in one run.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.models.peers [n ...] [--data FOLDER] [--python PYTHON] [--steps 200]

Ours: GP, VHGP, and the sparse VHGP from 500 rows on. Peers: scikit-learn's GP; in the interpreter PYTHON, if installed
there, GPflow's heteroskedastic SVGP (100 inducing inputs) and hetgpy's hetGP. Rows are made up, or with --data those of
FOLDER/mit_square, split at random and by push. CPU seconds: fitting three outputs on one thread without imports; the
ratio is to our VHGP. NLPD in the units of the rows (made up: 1, measured: SI), summed over the outputs, of the Gaussian
and of the exact predictive density.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured.square import imported_square
from benchmarks.models.training import cpu_seconds, fit_reference, made_up_pushes
from push_predictor.evaluation.metrics import nmse
from push_predictor.evaluation.splits import random_split, split_by_push
from push_predictor.models.gaussian_process.gp import fit_gp
from push_predictor.models.gaussian_process.prediction import LatentPrediction
from push_predictor.models.gaussian_process.quadrature import exact_log_density, gaussian_log_density
from push_predictor.models.gaussian_process.sparse.fit import fit_sparse_vhgp
from push_predictor.models.gaussian_process.vhgp import fit_vhgp
from push_predictor.types import Array, IntArray

SPARSE_FROM = 500
INDUCING = 100
HELD_OUT = 2000  # of made-up rows
NAMES = ("mean", "variance", "log_noise_mean", "log_noise_variance")
HEAD = "rows                      n  model                CPU s   / VHGP    NMSE     NLPD   exact"


@dataclass(frozen=True)
class Rows:
    """Standardised inputs and outputs to learn from, new inputs (q, D) and outputs (q, k); sd (k,) of the outputs."""

    title: str
    inputs: Array
    outputs: Array
    new: Array
    truth: Array
    sd: Array

    def first(self, n: int) -> Rows:
        """The same with only the first n training rows."""
        return Rows(self.title, self.inputs[:n], self.outputs[:n], self.new, self.truth, self.sd)


@dataclass(frozen=True)
class Fitted:
    """Predictions of the new rows by a model of three outputs, and the CPU seconds of its fit."""

    predictions: list[LatentPrediction]
    seconds: float


def main() -> None:
    """Print a line for each model and number of rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sizes", nargs="*", type=int, default=[100, 500, 1000])
    parser.add_argument("--data", type=Path, help="folder that holds mit_square")
    parser.add_argument("--python", type=Path, help="an interpreter with gpflow and hetgpy")
    parser.add_argument("--steps", type=int, default=200, help="of GPflow's optimisers")
    parser.add_argument("--slowest", type=int, default=500, help="rows up to which hetgpy is run")
    options = parser.parse_args()
    print(f"load average {os.getloadavg()[0]:.1f}\n{HEAD}")
    sets = square_rows(options.data) if options.data else [made_up_rows(max(options.sizes))]
    for n in options.sizes:
        for rows in sets:
            compare(rows.first(n), ours(n), peers(n, options.python, options.steps, options.slowest))
    print(f"load average {os.getloadavg()[0]:.1f}")


def compare(rows: Rows, *groups: dict[str, Callable[[Rows], Fitted]]) -> None:
    """Print a line for each model of each group, with times relative to the first one."""
    reference = None
    for name, fit in [item for group in groups for item in group.items()]:
        try:
            fitted = fit(rows)
        except subprocess.CalledProcessError as error:
            print(f"{rows.title:20s} {len(rows.inputs):6d}  {name:18s} not run: {last_line(error.stderr)}")
            continue
        reference = reference or fitted.seconds
        times = f"{fitted.seconds:8.2f} {fitted.seconds / reference:8.2f}"
        print(f"{rows.title:20s} {len(rows.inputs):6d}  {name:18s} {times} {scores(rows, fitted)}", flush=True)


def ours(n: int) -> dict[str, Callable[[Rows], Fitted]]:
    """Fits of our models for n rows."""
    models = {"VHGP": each_output(fit_vhgp), "GP": each_output(fit_gp)}
    return {**models, f"sparse VHGP {INDUCING}": sparse(INDUCING)} if n >= SPARSE_FROM else models


def sparse(inducing: int) -> Callable[[Rows], Fitted]:
    """Our sparse VHGP."""
    return each_output(lambda inputs, outputs: fit_sparse_vhgp(inputs, outputs, inducing))


def each_output(fit: Callable[[Array, Array], Any]) -> Callable[[Rows], Fitted]:
    """A regression of ours for each output."""

    def fitted(rows: Rows) -> Fitted:
        seconds, models = cpu_seconds(lambda: [fit(rows.inputs, column) for column in rows.outputs.T])
        return Fitted([model.predict(rows.new) for model in models], seconds)

    return fitted


def peers(n: int, python: Path | None, steps: int, slowest: int) -> dict[str, Callable[[Rows], Fitted]]:
    """Fits of other libraries' models for n rows."""
    models: dict[str, Callable[[Rows], Fitted]] = {"scikit-learn GP": scikit_learn}
    if python is not None:
        models[f"GPflow SVGP {INDUCING}"] = elsewhere("gpflow", python, steps)
        if n <= slowest:
            models["hetgpy hetGP"] = elsewhere("hetgpy", python)
    return models


def scikit_learn(rows: Rows) -> Fitted:
    """Its homoscedastic GP with a squared exponential."""
    seconds, models = cpu_seconds(lambda: [fit_reference(rows.inputs, column) for column in rows.outputs.T])
    predictions = []
    for model in models:
        mean, sd = model.predict(rows.new, return_std=True)
        noise = np.full(len(mean), model.kernel_.k2.noise_level)
        predictions.append(LatentPrediction(mean, sd**2 - noise, np.log(noise), np.zeros(len(mean))))
    return Fitted(predictions, seconds)


def elsewhere(kind: str, python: Path, steps: int = 0, inducing: int = INDUCING) -> Callable[[Rows], Fitted]:
    """A fit by peer_fits.py in another interpreter, on one thread. Raises CalledProcessError if that fails."""

    def fitted(rows: Rows) -> Fitted:
        with tempfile.TemporaryDirectory(prefix="peers_") as folder:
            given, found = Path(folder) / "rows.npz", Path(folder) / "predictions.npz"
            np.savez(given, x=rows.inputs, y=rows.outputs, new=rows.new, inducing=inducing, steps=steps)
            script = Path(__file__).with_name("peer_fits.py")
            one = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "TF_CPP_MIN_LOG_LEVEL": "3"}
            command = [str(python), str(script), kind, str(given), str(found)]
            subprocess.run(command, check=True, capture_output=True, text=True, env=one)
            with np.load(found) as file:
                columns = [[file[name][:, k] for name in NAMES] for k in range(rows.outputs.shape[1])]
                return Fitted([LatentPrediction(*column) for column in columns], float(file["seconds"]))

    return fitted


def scores(rows: Rows, fitted: Fitted) -> str:
    """NMSE, Gaussian and exact NLPD, summed over the outputs."""
    pairs = list(zip(fitted.predictions, rows.truth.T, strict=True))
    shift = float(np.log(rows.sd).sum())
    error = nmse(np.column_stack([p.mean for p, _ in pairs]), rows.truth, np.zeros(len(rows.sd))).sum()
    gaussian, exact = (
        shift - sum(float(density(p, y).mean()) for p, y in pairs)
        for density in (gaussian_log_density, exact_log_density)
    )
    return f"{error:7.4f} {gaussian:8.3f} {exact:8.3f}"


def made_up_rows(n: int) -> Rows:
    """Rows of two inputs, to learn from and held out."""
    inputs, outputs = made_up_pushes(n + HELD_OUT)
    mean, sd = outputs[:n].mean(axis=0), outputs[:n].std(axis=0)
    scaled = (outputs - mean) / sd
    return Rows("made up", inputs[:n], scaled[:n], inputs[n:], scaled[n:], sd)


def square_rows(data: Path, folds: int = 1) -> Sequence[Rows]:
    """The measured square: contact and angle; a random split and the first folds by push."""
    with tempfile.TemporaryDirectory(prefix="peers_") as work:
        table = imported_square(data, Path(work)).table
    splits = {"square, random": random_split(table, 0)}
    splits |= {f"square, by push {fold}": split_by_push(table, fold) for fold in range(folds)}
    return [
        standardised(title, table.inputs[:, 1:], table.outcomes, split.training, split.test)
        for title, split in splits.items()
    ]


def standardised(title: str, inputs: Array, outcomes: Array, training: IntArray, test: IntArray) -> Rows:
    """Rows standardised by mean and standard deviation of the training rows."""
    x, y = ((values - values[training].mean(axis=0)) / values[training].std(axis=0) for values in (inputs, outcomes))
    return Rows(title, x[training], y[training], x[test], y[test], outcomes[training].std(axis=0))


def last_line(text: str) -> str:
    """The last line of an error message."""
    return text.strip().splitlines()[-1] if text.strip() else "no message"


if __name__ == "__main__":
    main()
