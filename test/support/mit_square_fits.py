# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The shared rows of the measured square, the two splits of them, and regressors fitted on them, kept for reuse."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from push_predictor_paper.fits.fit import random_split as random_rows

from push_predictor.evaluation import splits
from push_predictor.evaluation.metrics import nmse
from push_predictor.models.gaussian_process.gp import GaussianProcess, fit_gp
from push_predictor.models.gaussian_process.prediction import exact_log_density, gaussian_log_density
from push_predictor.models.gaussian_process.vhgp import VHGP, fit_vhgp
from push_predictor.recordings.importers.mit_square import read_mit_square, square_rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, BoolArray, IntArray

ROWS = 3500


@dataclass(frozen=True)
class Square:
    """Rows (3500,) of contact and angle -> dx, dy to the left, dtheta, and the table that `import mit-square` reads."""

    inputs: Array
    outputs: Array
    table: PushTable
    subset: dict[int, BoolArray]


@cache
def load_square(folder: Path) -> Square:
    path = folder / "mit_square" / "pushes_3500.npz"
    with np.load(path) as file:
        outputs = np.column_stack([file["dx"], -file["dy"], file["dtheta"]])
        subset = {n: file[f"in_subset_{n}"] for n in (100, 200, 500, 1000)}
        inputs = np.column_stack([file["c"], file["beta"]])
    return Square(inputs, outputs, read_mit_square(path, square_rig().outline), subset)


def random_split(n: int, seed: int) -> tuple[IntArray, IntArray]:
    """Training and test rows; windows of one push fall on both sides, so this tests interpolation only."""
    split = random_rows(ROWS, seed)
    return split.first(n), split.test


def split_by_push(square: Square, n: int, fold: int) -> tuple[IntArray, IntArray]:
    """Training and test rows of different pushes."""
    split = splits.split_by_push(square.table, fold)
    return split.first(n), split.test


@dataclass(frozen=True)
class Scaled:
    """Three regressors on standardised rows, and the scales to and from SI."""

    models: list[GaussianProcess | VHGP]
    input_mean: Array
    input_sd: Array
    output_mean: Array
    output_sd: Array

    def scores(self, inputs: Array, outputs: Array) -> Scores:
        """Of rows (m, 2) -> (m, 3) in SI units."""
        standard = (outputs - self.output_mean) / self.output_sd
        predictions = [model.predict((inputs - self.input_mean) / self.input_sd) for model in self.models]
        pairs = list(zip(predictions, standard.T, strict=True))
        shift = np.log(self.output_sd)
        mean = np.column_stack([p.mean for p in predictions])
        return Scores(
            nmse=float(nmse(mean, standard, np.zeros(3)).sum()),
            nlpd=float((shift - [gaussian_log_density(p, y).mean() for p, y in pairs]).sum()),
            exact_nlpd=float((shift - [exact_log_density(p, y).mean() for p, y in pairs]).sum()),
        )


@dataclass(frozen=True)
class Scores:
    """Sums over the three outputs; densities in SI units."""

    nmse: float
    nlpd: float
    exact_nlpd: float


def fit_scaled(inputs: Array, outputs: Array, kind: str) -> Scaled:
    """Three `gp` or `vhgp` regressors of rows (n, 2) -> (n, 3)."""
    scales = inputs.mean(axis=0), inputs.std(axis=0), outputs.mean(axis=0), outputs.std(axis=0)
    x, y = (inputs - scales[0]) / scales[1], (outputs - scales[2]) / scales[3]
    fit = {"gp": fit_gp, "vhgp": fit_vhgp}[kind]
    return Scaled([fit(x, column) for column in y.T], *scales)


@cache
def scores(folder: Path, split: str, kind: str, n: int, seed: int) -> Scores:
    """Of a fit on the `random` split of this seed or on the split by `push` with this fold held out."""
    square = load_square(folder)
    training, test = random_split(n, seed) if split == "random" else split_by_push(square, n, seed)
    fitted = fit_scaled(square.inputs[training], square.outputs[training], kind)
    return fitted.scores(square.inputs[test], square.outputs[test])


def mean_scores(folder: Path, split: str, kind: str, n: int, seeds: int) -> Scores:
    """Mean over the first seeds or folds."""
    table = [scores(folder, split, kind, n, seed) for seed in range(seeds)]
    return Scores(*(float(np.mean([getattr(s, name) for s in table])) for name in ("nmse", "nlpd", "exact_nlpd")))
