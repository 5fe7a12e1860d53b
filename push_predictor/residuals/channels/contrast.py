# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""New windows against training windows: regressions whose coefficients are the change since training.

The rows of both tables are stacked. A column that is nonzero on the new rows alone, with the same column on all rows
among the controls, has as its coefficient the new relation minus that in training.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.evidence.residualizer import Residualizer, sums_by
from push_predictor.residuals.evidence.split import FEWEST_PUSHES
from push_predictor.residuals.evidence.standardised import blocks_of
from push_predictor.residuals.outcome import Sized, Tested
from push_predictor.residuals.selection.screening import Controlled, Screened, screen
from push_predictor.types import Array, BoolArray, IntArray

DRAWS = 1000
FOLDS = 5
GROSS = 5.0  # robust standard deviations; guards against gross errors: windows farther out are rejected
TRIMMING_ROUNDS = 4
MAD_TO_SD = 1.4826
COLLINEAR = 1e-6  # share of a column's square that the controls do not explain; less counts as collinear


@dataclass(frozen=True)
class ChannelEffect:
    """An effect on a recorded quantity, with its family-wise p value; rivals: what fits equally well.

    parameters: of a measurement error, the slider's stream against the robot's; of surface_friction, the relative
    change of the force from the 5th to the 95th percentile of the covariate, or since training where it is constant; of
    wrench_bias, what the force reads too much (N, N) along the world's axes.
    """

    mechanism: str
    covariate: str
    basis: str
    parameters: tuple[Sized, ...]
    p_value: float
    rivals: tuple[str, ...] = ()

    @property
    def values(self) -> tuple[float, ...]:
        """The parameters' estimates, as measurement.correct takes them."""
        return tuple(parameter.value for parameter in self.parameters)


@dataclass(frozen=True)
class ChannelFinding:
    """Effects on a recorded quantity, strongest first, and all candidates tested.

    zero: a bias of the force sensor that the windows do not contain.
    """

    effects: tuple[ChannelEffect, ...]
    tested: tuple[Tested, ...]
    zero: ChannelEffect | None = None


NOTHING_FOUND = ChannelFinding((), ())


@dataclass(frozen=True, eq=False)
class Contrast:
    """A candidate for a recorded quantity: columns (n, k, p), zero on training rows; shared (n, m): on all rows."""

    mechanism: str
    covariate: str
    basis: DriverBasis
    columns: Array
    shared: Array

    def take(self, rows: BoolArray) -> Contrast:
        """The contrast on the given rows."""
        return replace(self, columns=self.columns[rows], shared=self.shared[rows])


@dataclass(frozen=True, eq=False)
class Stacked:
    """n rows of the tables, training windows first: which rows are new (n,), and the block of pushes of each (n,)."""

    tables: tuple[PushTable, ...]
    new: BoolArray
    block: IntArray

    def joined(self, columns: list[Array]) -> Array:
        """Columns of all tables, one after the other."""
        return np.concatenate(columns)


def stacked(windows: PushTable, baseline: PushTable | None, needed: tuple[str, ...]) -> Stacked:
    """Training windows, then new windows; the former are dropped if they lack a needed covariate or are few."""
    usable = (
        baseline is not None
        and all(name in baseline.covariates for name in needed)
        and len(baseline.pushes) >= FEWEST_PUSHES
    )
    tables = (baseline, windows) if usable and baseline is not None else (windows,)
    blocks, begin = [], 0
    for table in tables:
        blocks.append(blocks_of(table) + begin)
        begin = int(blocks[-1].max()) + 1
    new = np.concatenate([np.full(len(table), table is windows) for table in tables])
    return Stacked(tables, new, np.concatenate(blocks))


def block_diagonal(columns: list[Array]) -> Array:
    """Columns (n_k, m) of each table as a block-diagonal matrix (sum n_k, sum m)."""
    wide = np.zeros((sum(map(len, columns)), sum(c.shape[1] for c in columns)))
    row = column = 0
    for part in columns:
        wide[row : row + len(part), column : column + part.shape[1]] = part
        row, column = row + len(part), column + part.shape[1]
    return wide


def inliers(z: Array, columns: Array, controls: Array) -> BoolArray:
    """Rows (n,) of z (n, k) within GROSS deviations of their fit by controls (n, m) and columns (n, k, p)."""
    keep = np.ones(len(z), dtype=np.bool_)
    for _ in range(TRIMMING_ROUNDS):
        residual = np.column_stack(
            [_residual(z[:, k], np.column_stack([controls, columns[:, k]]), keep) for k in range(z.shape[1])]
        )
        spread = MAD_TO_SD * np.median(np.abs(residual[keep]), axis=0)
        keep = np.all(np.abs(residual) <= GROSS * np.maximum(spread, np.finfo(float).tiny), axis=1)
    return keep


def screen_contrasts(z: Array, tried: Sequence[Contrast], controls: Array, block: IntArray, seed: int = 0) -> Screened:
    """Screen contrasts on z (n, k), with the controls and the columns shared with training regressed out."""
    known: dict[bytes, Controlled] = {}  # many share the same columns
    for each in tried:
        if (key := each.shared.tobytes()) not in known:
            known[key] = Controlled.of(z, np.column_stack([controls, each.shared]), block)
    return screen([known[each.shared.tobytes()].unit_scores(each.columns) for each in tried], seed)


def best_and_rivals(
    z: Array, tried: Sequence[Contrast], controls: Array, block: IntArray, seed: int = 0
) -> list[Contrast]:
    """The contrast with the largest cross-validated gain, then those not significantly worse at 5 %."""
    gains = [_gains(z, each, controls, block) for each in tried]
    order = np.argsort([-float(gain.sum()) for gain in gains], kind="stable").tolist()
    best = gains[order[0]]
    weights = _weights(len(best), seed)
    level = 0.05 / max(len(order) - 1, 1)  # Bonferroni: the best was selected among all of them
    alike = [k for k in order[1:] if float(np.quantile(weights @ (best - gains[k]), level)) <= 0.0]
    return [tried[k] for k in (order[0], *alike)]


def estimate_with_draws(
    z: Array, columns: Array, controls: Array, shared: Array, block: IntArray, seed: int = 0
) -> tuple[Array, Array]:
    """Coefficients (p,) of columns (n, k, p) for z (n, k), and bootstrap draws (DRAWS, p) of them by block."""
    residualizer = Residualizer(np.column_stack([controls, shared]))
    residual, flat = residualizer(z), residualizer(columns)
    p = flat.shape[2]
    square = sums_by(block, np.einsum("nkp,nkq->npq", flat, flat).reshape(len(z), -1)).reshape(-1, p, p)
    score = sums_by(block, np.einsum("nkp,nk->np", flat, residual))
    weights = _weights(len(score), seed)
    draws = _solved(np.tensordot(weights, square, axes=1), weights @ score)
    return _solved(square.sum(axis=0)[None], score.sum(axis=0)[None])[0], draws


def sized(parameters: Sequence[tuple[str, str]], values: Array, draws: Array) -> tuple[Sized, ...]:
    """Parameters (name, unit) with estimates (p,) and the 95 % intervals of draws (d, p)."""
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    each = zip(parameters, values.tolist(), low.tolist(), high.tolist(), strict=True)
    return tuple(Sized(name, value, least, most, unit) for (name, unit), value, least, most in each)


def is_identifiable(each: Contrast, controls: Array) -> bool:
    """Whether no column is collinear with the controls (n, m) and the shared columns."""
    residualizer = Residualizer(np.column_stack([controls, each.shared]))
    size, residual = (np.sum(values**2, axis=(0, 1)) for values in (each.columns, residualizer(each.columns)))
    return bool(np.all(residual > COLLINEAR * size) and np.all(size > 0.0))


def robust_deviation(values: Array) -> float:
    """Robust standard deviation of values (n,), from the median absolute deviation."""
    return float(MAD_TO_SD * np.median(np.abs(values - np.median(values))))


def _gains(z: Array, each: Contrast, controls: Array, block: IntArray) -> Array:
    """Cross-validated gain (b,) in nats of each block."""
    residualizer = Residualizer(np.column_stack([controls, each.shared]))
    residual, flat = Residualizer(controls)(z), residualizer(each.columns)
    gains = np.zeros((len(z), 1))
    for fold in range(FOLDS):
        test = block % FOLDS == fold
        x = flat[~test].reshape(-1, flat.shape[2])
        after = residual - flat @ np.linalg.lstsq(x, residual[~test].ravel(), rcond=None)[0]
        before_log, after_log = (_log_density(r[test], np.mean(r[~test] ** 2, axis=0)) for r in (residual, after))
        gains[test, 0] = after_log - before_log
    return sums_by(block, gains)[:, 0]


def _log_density(residual: Array, variance: Array) -> Array:
    variance = np.maximum(variance, np.finfo(float).tiny)  # a quantity may follow the controls exactly
    return np.asarray(-0.5 * np.sum(np.log(variance) + residual**2 / variance, axis=1))


def _weights(blocks: int, seed: int) -> Array:
    draws = np.random.default_rng(seed).multinomial(blocks, np.full(blocks, 1.0 / blocks), size=DRAWS)
    return draws.astype(np.float64)


def _residual(z: Array, design: Array, rows: BoolArray) -> Array:
    coefficients = np.linalg.lstsq(design[rows], z[rows], rcond=None)[0]
    return np.asarray(z - design @ coefficients)


def _solved(square: Array, score: Array) -> Array:
    """Minimum-norm solutions (d, p) of d linear systems."""
    return np.asarray(np.einsum("dpq,dq->dp", np.linalg.pinv(square, rcond=1e-12, hermitian=True), score))
