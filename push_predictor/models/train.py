"""Training a push model from a push table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from push_predictor import __version__
from push_predictor.errors import TrainingError
from push_predictor.models.correlation_fit import fit_correlation
from push_predictor.models.features import push_features
from push_predictor.models.gaussian_process.gp import GaussianProcess, fit_gp
from push_predictor.models.gaussian_process.kernels import DEFAULT_CHOICE, KernelChoice
from push_predictor.models.gaussian_process.sparse.fit import DEFAULT_INDUCING, fit_sparse_vhgp
from push_predictor.models.gaussian_process.sparse.vhgp import SparseVHGP
from push_predictor.models.gaussian_process.vhgp import VHGP, fit_vhgp
from push_predictor.models.mechanics.analytical import AnalyticalPush, fit_analytical
from push_predictor.models.push_model import (
    KINDS,
    AnalyticalPredictor,
    GaussianProcessPredictor,
    Provenance,
    PushModel,
    Scaling,
    scaled_features,
)
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.types import Array, IntArray

DEFAULT_ROWS = 1000
FEWEST_ROWS = 10
MOST_DENSE_ROWS = (
    2000  # a dense VHGP of so many takes 46 CPU s and 240 MB, one of twice as many eight and four times that
)
CONSTANT = 1e-9  # a feature whose spread is below this part of its size does not vary


def train_model(
    table: PushTable,
    rig: Rig,
    kind: str,
    *,
    name: str,
    sources: Sequence[str] = (),
    n_train: int | None = None,
    seed: int = 0,
    fit: bool = False,
    choice: KernelChoice = DEFAULT_CHOICE,
    inducing: int | None = None,
) -> PushModel:
    """Train a model of one of KINDS on rows of the table.

    n_train: that many rows at random by default_rng(seed); None takes all up to 1000, beyond that 1000 drawn evenly
    over the pushes. fit: estimate the analytical model's friction and pressure instead of taking the textbook's.
    choice: the kernels of a learnt model. inducing: how many inducing inputs a VHGP is to have; None for a dense one of
    up to MOST_DENSE_ROWS rows, and for a usual number beyond.
    Raises TrainingError for an unknown kind, too few rows, outcomes that do not vary, or inducing inputs where no model
    has them.
    """
    if kind not in KINDS:
        raise TrainingError(f"model: {kind!r} is not accepted, give one of {', '.join(KINDS)}")
    rows = table.take(training_rows(table, n_train, seed))
    if len(rows) < FEWEST_ROWS:
        raise TrainingError(f"{len(rows)} training windows are too few, give at least {FEWEST_ROWS}")
    most_inducing = inducing_inputs(kind, len(rows), inducing)
    predictor = (
        _analytical(rows, rig, fit) if kind == "analytical" else _learned(rows, rig, kind, choice, most_inducing)
    )
    provenance = Provenance(tuple(sources), len(rows.pushes), seed, __version__)
    return PushModel(name, kind, rig, predictor, rows, provenance)


def inducing_inputs(kind: str, rows: int, wanted: int | None = None) -> int | None:
    """How many inducing inputs a model of so many rows gets, None for a dense one; see train_model."""
    if wanted is None:
        return DEFAULT_INDUCING if kind == "vhgp" and rows > MOST_DENSE_ROWS else None
    if kind != "vhgp":
        raise TrainingError(f"inducing: {wanted} is not accepted, only a vhgp has inducing inputs")
    if wanted < 1:
        raise TrainingError(f"inducing: {wanted} is not accepted, give 1 or more")
    return wanted


def training_rows(table: PushTable, n_train: int | None, seed: int) -> IntArray:
    """Indices of the training rows; see train_model."""
    count = len(table)
    if n_train is None:
        return np.arange(count) if count <= DEFAULT_ROWS else _even_over_pushes(table, DEFAULT_ROWS, seed)
    if not 0 < n_train <= count:
        raise TrainingError(f"n_train: {n_train} is not accepted, give 1 to {count}, the rows there are")
    return np.sort(np.random.default_rng(seed).permutation(count)[:n_train])


def _even_over_pushes(table: PushTable, n_train: int, seed: int) -> IntArray:
    """Every push gives its k-th random row before any gives its (k+1)-th."""
    order = np.random.default_rng(seed).permutation(len(table))
    turn = np.empty(len(table), dtype=np.int64)
    taken: dict[str, int] = {}
    for row in order:
        push = table.push_id[row]
        turn[row] = taken[push] = taken.get(push, -1) + 1
    return np.sort(order[np.argsort(turn[order], kind="stable")][:n_train])


def _learned(
    rows: PushTable, rig: Rig, kind: str, choice: KernelChoice, most_inducing: int | None
) -> GaussianProcessPredictor:
    scaling = _scaling(rows, rig)
    features = scaled_features(rig, scaling, rows.inputs)
    scaled = (rows.outcomes - scaling.outcome_mean) / scaling.outcome_sd
    regressions = (_regression(features, column, kind, choice, most_inducing) for column in scaled.T)
    predictor = GaussianProcessPredictor(rig, scaling, tuple(regressions))
    return replace(predictor, correlation=fit_correlation(predictor, rows.push_id))


def _regression(
    features: Array, column: Array, kind: str, choice: KernelChoice, most_inducing: int | None
) -> GaussianProcess | VHGP | SparseVHGP:
    if kind == "gp":
        return fit_gp(features, column, choice)
    if most_inducing is None:
        return fit_vhgp(features, column, choice)
    if choice != DEFAULT_CHOICE:
        raise TrainingError(f"{choice}: a sparse VHGP has squared exponential kernels and no nugget")
    return fit_sparse_vhgp(features, column, most_inducing)


def _scaling(rows: PushTable, rig: Rig) -> Scaling:
    features = push_features(rig.outline, rows.inputs)
    spread = np.ptp(features, axis=0)
    columns = np.flatnonzero(spread > CONSTANT * (1.0 + np.abs(features).max(axis=0)))
    outcome_sd = rows.outcomes.std(axis=0)
    for name, sd in zip(OUTPUTS, outcome_sd, strict=True):
        if not sd > 0.0:
            raise TrainingError(f"{name}: does not vary over the {len(rows)} training windows, nothing can be learnt")
    if not columns.size:
        raise TrainingError("velocity, contact and angle are the same in all training windows, nothing can be learnt")
    used = features[:, columns]
    return Scaling(
        tuple(int(c) for c in columns), used.mean(axis=0), used.std(axis=0), rows.outcomes.mean(axis=0), outcome_sd
    )


def _analytical(rows: PushTable, rig: Rig, fit: bool) -> AnalyticalPredictor:
    physics = AnalyticalPush(rig.outline, rig.pusher_radius)
    if fit:
        physics = fit_analytical(physics, rows.inputs, rows.duration, rows.outcomes)
    residuals = rows.outcomes - physics.displacement(rows.inputs, rows.duration)
    return AnalyticalPredictor(physics, residuals.T @ residuals / len(residuals))
