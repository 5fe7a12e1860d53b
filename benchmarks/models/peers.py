# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Training cost and quality next to other libraries, on the same rows in one run.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.models.peers [n ...] [--data FOLDER] [--python PYTHON] [--steps 200]

Ours: GP, VHGP, and the sparse VHGP from 500 rows on. Peers: scikit-learn's GP; in the interpreter PYTHON, if installed
there, GPflow's heteroskedastic SVGP (100 inducing inputs) and hetgpy's hetGP. Rows are made up, or with --data those of
FOLDER/mit_square, split at random and by push. With --mechanics every model is also fitted to the residuals of our
mechanics, which are fitted to the same training rows: the gain of the physics and that of the noise model are then
seen apart. CPU seconds: fitting three outputs on one thread without imports and without the mechanics, whose time has
its own line; the ratio is to our VHGP. NLPD in the units of the rows (made up: 1, measured: SI), summed over the
outputs, of the Gaussian and of the exact predictive density.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured.square import imported_square
from benchmarks.models.training import cpu_seconds, fit_reference, made_up_pushes
from push_predictor.evaluation.splits import random_split, split_by_push
from push_predictor.models.gaussian_process.gp import fit_gp
from push_predictor.models.gaussian_process.prediction import LatentPrediction, exact_log_density, gaussian_log_density
from push_predictor.models.gaussian_process.sparse_vhgp import fit_sparse_vhgp
from push_predictor.models.gaussian_process.vhgp import fit_vhgp
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.train_learnt import fitted_mean
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, IntArray

SPARSE_FROM = 500
INDUCING = 100
HELD_OUT = 2000  # of made-up rows
NAMES = ("mean", "variance", "log_noise_mean", "log_noise_variance")
HEAD = "rows                      n  model                CPU s   / VHGP    NMSE     NLPD   exact"


@dataclass(frozen=True)
class Rows:
    """Standardised inputs and outputs to learn from, new inputs (q, D) and outputs (q, k).

    sd (k,): of the outputs in their units. mean_error (k,): mean square of new outcomes about the training mean, in
    units of sd; the NMSE is relative to it.
    """

    title: str
    inputs: Array
    outputs: Array
    new: Array
    truth: Array
    sd: Array
    mean_error: Array

    def first(self, n: int) -> Rows:
        """The same with only the first n training rows."""
        return replace(self, inputs=self.inputs[:n], outputs=self.outputs[:n])


@dataclass(frozen=True, eq=False)
class Measured:
    """A split of measured pushes; the training rows are in the order in which they are drawn."""

    title: str
    table: PushTable
    rig: Rig
    training: IntArray
    test: IntArray

    def both(self, n: int, informed: bool) -> list[Rows]:
        """Plain rows, and those with mechanics."""
        return [self.rows(n), self.informed_rows(n)] if informed else [self.rows(n)]

    def rows(self, n: int) -> Rows:
        """The first n training rows: contact and angle to outcomes."""
        return self._standardised(self.title, n, np.zeros_like(self.table.outcomes))

    def informed_rows(self, n: int) -> Rows:
        """The same with the residuals of the mechanics that are fitted to these n rows."""
        known = self.table.take(self.training[:n])
        seconds, mechanics = cpu_seconds(lambda: fitted_mechanics(self.rig, known))
        print(f"{self.title:20s} {n:6d}  {'mechanics':18s} {seconds:8.2f}", flush=True)
        moved = mechanics.displacement(self.table.inputs, self.table.duration, self.table.covariates)
        return self._standardised(f"{self.title} informed", n, moved)

    def _standardised(self, title: str, n: int, mean: Array) -> Rows:
        training, residuals = self.training[:n], self.table.outcomes - mean
        rows = standardised(title, self.table.inputs[:, 1:], residuals, training, self.test)
        centre = self.table.outcomes[training].mean(axis=0)
        return replace(rows, mean_error=np.mean(((self.table.outcomes[self.test] - centre) / rows.sd) ** 2, axis=0))


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
    parser.add_argument("--mechanics", action="store_true", help="also fit the residuals of our mechanics")
    parser.add_argument("--folds", type=int, default=1, help="number of folds by push, 1 to 5")
    options = parser.parse_args()
    print(f"load average {os.getloadavg()[0]:.1f}\n{HEAD}")
    sets = square_rows(options.data, options.folds) if options.data else []
    for n in options.sizes:
        several = [rows for one in sets for rows in one.both(n, options.mechanics)] or [made_up_rows(n)]
        for rows in several:
            compare(rows, ours(n), peers(n, options.python, options.steps, options.slowest))
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
    square = np.mean((np.column_stack([p.mean for p, _ in pairs]) - rows.truth) ** 2, axis=0)
    error = float(np.sum(square / rows.mean_error))
    gaussian, exact = (
        shift - sum(float(density(p, y).mean()) for p, y in pairs)
        for density in (gaussian_log_density, exact_log_density)
    )
    return f"{error:7.4f} {gaussian:8.3f} {exact:8.3f}"


def made_up_rows(n: int) -> Rows:
    """Rows of two inputs, to learn from and held out."""
    inputs, outputs = made_up_pushes(n + HELD_OUT)
    order = np.arange(n + HELD_OUT)
    return standardised("made up", inputs, outputs, order[:n], order[n:])


def square_rows(data: Path, folds: int = 1) -> list[Measured]:
    """The measured square: contact and angle; a random split and the first folds by push."""
    with tempfile.TemporaryDirectory(prefix="peers_") as work:
        square = imported_square(data, Path(work))
    splits = {"square, random": random_split(square.table, 0)}
    splits |= {f"square, by push {fold}": split_by_push(square.table, fold) for fold in range(folds)}
    return [Measured(title, square.table, square.rig, split.training, split.test) for title, split in splits.items()]


def fitted_mechanics(rig: Rig, known: PushTable) -> FittedMechanics:
    """The mean of an informed model of these rows."""
    return fitted_mean(known, rig).mean


def standardised(title: str, inputs: Array, outcomes: Array, training: IntArray, test: IntArray) -> Rows:
    """Rows standardised by mean and standard deviation of the training rows."""
    x, y = ((values - values[training].mean(axis=0)) / values[training].std(axis=0) for values in (inputs, outcomes))
    sd = outcomes[training].std(axis=0)
    return Rows(title, x[training], y[training], x[test], y[test], sd, np.mean(y[test] ** 2, axis=0))


def last_line(text: str) -> str:
    """The last line of an error message."""
    return text.strip().splitlines()[-1] if text.strip() else "no message"


if __name__ == "__main__":
    main()
