"""Training a push model from a push table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from push_predictor import __version__
from push_predictor.errors import TrainingError
from push_predictor.models.analytical import AnalyticalPush, fit_analytical
from push_predictor.models.features import push_features
from push_predictor.models.gp import GaussianProcess, fit_gp
from push_predictor.models.kernels import DEFAULT_CHOICE, KernelChoice
from push_predictor.models.push_model import (
    KINDS,
    AnalyticalBody,
    LearnedBody,
    Provenance,
    PushModel,
    Scaling,
    scaled_features,
)
from push_predictor.models.vhgp import VHGP, fit_vhgp
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.types import Array, IntArray

DEFAULT_ROWS = 1000
FEWEST_ROWS = 10
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
) -> PushModel:
    """Train a model of one of KINDS on rows of the table.

    n_train: that many rows at random by default_rng(seed); None takes all up to 1000, beyond that 1000 drawn evenly
    over the pushes. fit: estimate the analytical model's friction and pressure instead of taking the textbook's.
    choice: the kernels of a learnt model.
    Raises TrainingError for an unknown kind, too few rows, or outcomes that do not vary.
    """
    if kind not in KINDS:
        raise TrainingError(f"model: {kind!r} is not accepted, give one of {', '.join(KINDS)}")
    rows = table.take(training_rows(table, n_train, seed))
    if len(rows) < FEWEST_ROWS:
        raise TrainingError(f"{len(rows)} training windows are too few, give at least {FEWEST_ROWS}")
    body = _analytical(rows, rig, fit) if kind == "analytical" else _learned(rows, rig, kind, choice)
    provenance = Provenance(tuple(sources), len(rows.pushes), seed, __version__)
    return PushModel(name, kind, rig, body, rows, provenance)


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


def _learned(rows: PushTable, rig: Rig, kind: str, choice: KernelChoice) -> LearnedBody:
    scaling = _scaling(rows, rig)
    features = scaled_features(rig, scaling, rows.inputs)
    scaled = (rows.outcomes - scaling.outcome_mean) / scaling.outcome_sd
    return LearnedBody(rig, scaling, tuple(_regression(features, column, kind, choice) for column in scaled.T))


def _regression(features: Array, column: Array, kind: str, choice: KernelChoice) -> GaussianProcess | VHGP:
    return fit_gp(features, column, choice) if kind == "gp" else fit_vhgp(features, column, choice)


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


def _analytical(rows: PushTable, rig: Rig, fit: bool) -> AnalyticalBody:
    physics = AnalyticalPush(rig.outline, rig.pusher_radius)
    if fit:
        physics = fit_analytical(physics, rows.inputs, rows.duration, rows.outcomes)
    residuals = rows.outcomes - physics.displacement(rows.inputs, rows.duration)
    return AnalyticalBody(physics, residuals.T @ residuals / len(residuals))
