# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Training a push model from a push table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from push_predictor import __version__
from push_predictor.blas_threads import one_blas_thread
from push_predictor.errors import TrainingError
from push_predictor.models.gaussian_process.sparse_vhgp import DEFAULT_INDUCING
from push_predictor.models.mechanics.fitted import FittedMechanics, analytical_mechanics
from push_predictor.models.mechanics.forward import mechanics_on
from push_predictor.models.mechanics.ladder import Rung
from push_predictor.models.predictors import GaussianProcessPredictor, Predictor, PriorPredictor
from push_predictor.models.push_model import KINDS, LEARNT, Provenance, PushModel
from push_predictor.models.train_learnt import MEANS, MeanChoice, train_learnt
from push_predictor.models.train_mechanics import predictor_about, prior_predictor, sharpened, train_mechanics
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array, IntArray
from push_predictor.watch import Watch, no_watch

DEFAULT_ROWS = 1000
MOST_FITTED_ROWS = 4000  # of fitted mechanics, unless n_train is given
MOST_SEARCHED_ROWS = 800  # by the ladder of fitted mechanics
MOST_MEAN_ROWS = 500  # to which the mechanics of a learnt model are fitted
FEWEST_ROWS = 10
MOST_DENSE_ROWS = 1000  # of held-out pushes a sparse VHGP of 2000 rows is more accurate, in a seventh of the time


@dataclass(frozen=True)
class TrainingOptions:
    """How to train a model. Raises TrainingError for a value that no training accepts.

    n_train: draw this many rows at random with default_rng(seed). None takes all rows up to 1000; of more, it draws
    1000 evenly over the pushes (MOST_FITTED_ROWS with fit). fit: choose and estimate the mechanics' parameters of an
    analytical model; otherwise the textbook's values are used. supports: support points (k, 3) as in Rig, by the
    covariate `recording`, where recordings had others than the rig; used with fit.
    inducing: number of inducing inputs of a VHGP. None trains a dense VHGP on up to MOST_DENSE_ROWS rows, and beyond
    that a sparse one with DEFAULT_INDUCING. mean: of a learnt model: fitted mechanics, about
    which the residual is learnt, zero, or auto, which takes mechanics unless zero predicts held-out pushes clearly
    better. about: mechanics to learn about, as they are; mean is then not used. per_path: of a learnt model: whether
    outcomes are learnt per path length of the tip (models/features.py); without it, as they are, as in Bauza and
    Rodriguez 2017. tails: of a learnt model: whether to fit the distribution of new pushes (predictors/tails.py);
    without it, windows of a push are taken for independent. near: a predictor about the same mechanics, at whose
    hyperparameters the search of a VHGP begins: half of its time.
    """

    n_train: int | None = None
    seed: int = 0
    fit: bool = False
    inducing: int | None = None
    mean: MeanChoice = "auto"
    about: FittedMechanics | None = None
    per_path: bool = True
    supports: Mapping[int, Array] = field(default_factory=dict)
    tails: bool = True
    near: GaussianProcessPredictor | None = None

    def __post_init__(self) -> None:
        for name, value in (("n_train", self.n_train), ("inducing", self.inducing)):
            if value is not None and value < 1:
                raise TrainingError(f"{name}: {value} is not accepted, give 1 or more")
        if self.mean not in MEANS:
            raise TrainingError(f"mean: {self.mean!r} is not accepted, give one of {', '.join(MEANS)}")


def train_model(
    table: PushTable,
    rig: Rig,
    kind: str,
    *,
    name: str,
    sources: Sequence[str] = (),
    options: TrainingOptions = TrainingOptions(),
    watch: Watch = no_watch,
    ladder: list[Rung] | None = None,
) -> PushModel:
    """Train a model of one of KINDS on rows of the table.

    name: the model's name in files and requests. sources: names of the recordings or tables, for its provenance.
    watch: called with each stage and the share of the work done, 0 to 1, when the stage begins. ladder: a list to which
    the steps of fitted mechanics are added, none for other models.
    A prior model needs no rows. Raises TrainingError for an unknown kind, too few rows, outcomes that do not vary, or
    options that the kind does not have.
    """
    if kind not in KINDS:
        raise TrainingError(f"model: {kind!r} is not accepted, give one of {', '.join(KINDS)}")
    most = MOST_FITTED_ROWS if kind == "analytical" and options.fit else DEFAULT_ROWS
    rows = table.take(training_rows(table, options.n_train, options.seed, most))
    if len(rows) < FEWEST_ROWS and kind != "prior":
        raise TrainingError(f"{len(rows)} training windows are too few, give at least {FEWEST_ROWS}")
    with one_blas_thread():
        predictor, steps = _predictor(rows, rig, kind, options, watch)
    if ladder is not None:
        ladder += steps
    watch(f"trained {kind} on {len(rows)} windows of {len(rows.pushes)} pushes", 1.0)
    provenance = Provenance(tuple(sources), len(rows.pushes), options.seed, __version__)
    return PushModel(name, kind, rig, predictor, rows, provenance)


def _predictor(
    rows: PushTable, rig: Rig, kind: str, options: TrainingOptions, watch: Watch
) -> tuple[Predictor, list[Rung]]:
    options = replace(options, inducing=inducing_inputs(kind, len(rows), options.inducing))
    if kind in LEARNT:
        return train_learnt(rows, _spread(rows, MOST_MEAN_ROWS, options.seed), rig, kind, options, watch), []
    if kind == "analytical" and not options.fit:
        return predictor_about(analytical_mechanics(rig.outline, rig.pusher_radius), rows), []
    mechanics = mechanics_on(rig.outline, rig.pusher_radius, rig.support_points, options.supports)
    if kind == "analytical":
        return train_mechanics(mechanics, rows, _spread(rows, MOST_SEARCHED_ROWS, options.seed), watch)
    watch("train prior", 0.1)
    return sharpened(prior_predictor(mechanics, rig, options.seed), rows, options.seed), []


def retrain_model(model: PushModel, table: PushTable, *, nearby: bool = False) -> PushModel:
    """The model without effects, trained again on a table.

    A learnt one is refitted, per path length or not as before, on at most 1000 rows drawn evenly over the pushes.
    Mechanics keep their parameters, alone and as the mean of a learnt model: a change of these is what a trace looks
    for. The covariance of an analytical model is estimated again. The priors of a prior model are updated by the table.
    nearby: whether the search of a VHGP begins at the model's hyperparameters. From those of other outcomes it can end
    in a poorer optimum. Raises TrainingError for too few rows.
    """
    name, sources, seed = model.name, model.provenance.sources, model.provenance.seed
    if isinstance(predictor := model.predictor, GaussianProcessPredictor):
        options = TrainingOptions(
            seed=seed,
            mean="zero",
            about=predictor.mean,
            per_path=predictor.scaling.travel is not None,
            tails=predictor.tails is not None,
            near=predictor if nearby else None,
        )
        return train_model(table, model.rig, model.kind, name=name, sources=sources, options=options)
    provenance = Provenance(sources, len(table.pushes), seed, __version__)
    again: Predictor
    if isinstance(predictor, PriorPredictor):
        again = sharpened(prior_predictor(predictor.fitted.mechanics, model.rig, seed), table, seed)
    else:
        again = predictor_about(predictor.mechanics, table)
    return PushModel(name, model.kind, model.rig, again, table, provenance)


def inducing_inputs(kind: str, rows: int, wanted: int | None = None) -> int | None:
    """Number of inducing inputs of a model of this many rows, None for a dense one; see TrainingOptions."""
    if wanted is None:
        return DEFAULT_INDUCING if kind == "vhgp" and rows > MOST_DENSE_ROWS else None
    if kind != "vhgp":
        raise TrainingError(f"inducing: {wanted} is not accepted, only a vhgp has inducing inputs")
    return TrainingOptions(inducing=wanted).inducing


def training_rows(table: PushTable, n_train: int | None, seed: int, most: int = DEFAULT_ROWS) -> IntArray:
    """Indices of the training rows, unless n_train is given at most `most`; see TrainingOptions."""
    count = len(table)
    if n_train is None:
        return np.arange(count) if count <= most else _even_over_pushes(table, most, seed)
    if not 0 < n_train <= count:
        raise TrainingError(f"n_train: {n_train} is not accepted, give 1 to {count}, the number of rows")
    return np.sort(np.random.default_rng(seed).permutation(count)[:n_train])


def _spread(rows: PushTable, most: int, seed: int) -> PushTable:
    """The rows, or as many of them, drawn evenly over the pushes."""
    return rows.take(_even_over_pushes(rows, most, seed)) if len(rows) > most else rows


def _even_over_pushes(table: PushTable, n_train: int, seed: int) -> IntArray:
    """Draw one random row of each push, then a second one of each, until there are n_train."""
    order = np.random.default_rng(seed).permutation(len(table))
    turn = np.empty(len(table), dtype=np.int64)
    taken: dict[str, int] = {}
    for row in order:
        push = table.push_id[row]
        turn[row] = taken[push] = taken.get(push, -1) + 1
    return np.sort(order[np.argsort(turn[order], kind="stable")][:n_train])
