# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One model trained on a draw of rows and scored on held-out rows of the same set."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from push_predictor.evaluation.push_scores import PushScores, push_scores
from push_predictor.evaluation.splits import Split, split_by_push
from push_predictor.evaluation.validation import compare
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.types import Array, BoolArray
from push_predictor_paper.data.corpus import Corpus, Pair, PushSet
from push_predictor_paper.plan import WINDOW
from push_predictor_paper.work import Work

SplitName = Literal["push", "random", "none"]
RANDOM_TEST_ROWS = 1000
RANDOM_TEST_SHARE = 0.3  # of the rows, at most
SPLITS: tuple[SplitName, ...] = ("push", "random")
SPLIT_WORDS = {"push": "whole pushes held out (5 folds)", "random": "random split of windows"}
SPLIT_SHORT = {"push": "by push", "random": "random"}
KINDS = ("analytical", "gp", "vhgp")
KIND_NAMES = {"analytical": "analytical", "gp": "GP", "vhgp": "VHGP"}


@dataclass(frozen=True)
class Fit:
    """Which model: kind, training windows, split, and the seed of the draw (the held-out fold, by push).

    kind: one of KINDS; the learned models have a zero mean, as the paper's.
    Split `none` holds nothing back: for models that are scored on other pushes, those of the grid.
    """

    kind: str
    n: int
    split: SplitName
    seed: int


@dataclass(frozen=True, eq=False)
class Score:
    """Scores of a fit on the held-out windows of its split; predicted: their means (m, 3); cpu: s to train it."""

    fit: Fit
    push_scores: PushScores
    predicted: Array
    cpu: float = 0.0


def scores(work: Work, corpus: Corpus, fits: Sequence[tuple[Pair, Fit]]) -> dict[tuple[Pair, Fit], Score]:
    """Train and score all fits; those with more windows than the set has are skipped."""
    possible = [(pair, fit) for pair, fit in fits if fit.n <= len(split_of(corpus.sets[pair], fit).training)]
    calls = [(corpus.sets[pair], fit) for pair, fit in possible]
    return dict(zip(possible, work.run("models", score, calls), strict=True))


def score(pushes: PushSet, fit: Fit) -> Score:
    """Train and score one fit."""
    start = time.process_time()
    model = trained(pushes, fit)
    cpu = time.process_time() - start
    comparison = compare(model, pushes.table.take(split_of(pushes, fit).test))
    return Score(fit, push_scores(comparison), comparison.mean, cpu)


@dataclass(frozen=True, eq=False)
class Answer:
    """Predictions of m pushes: mean, sd of an outcome, sd of the process noise alone (m, 3); in_domain (m,)."""

    mean: Array
    sd: Array
    process_sd: Array
    in_domain: BoolArray


def ask(pushes: PushSet, fit: Fit, inputs: Array) -> Answer:
    """Train a model and predict pushes with inputs (m, 3), each one window long."""
    prediction = trained(pushes, fit).predict_rows(inputs, np.full(len(inputs), WINDOW))
    sd, process_sd = (
        np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        for covariance in (prediction.covariance, prediction.process_covariance)
    )
    return Answer(prediction.mean, sd, process_sd, prediction.in_domain)


def trained(pushes: PushSet, fit: Fit) -> PushModel:
    """Train the model of a fit."""
    rows = np.sort(split_of(pushes, fit).first(fit.n))
    table = pushes.table.take(rows)
    options = TrainingOptions(n_train=len(rows), seed=fit.seed, mean="zero", per_path=False, tails=False)
    return train_model(table, pushes.rig, fit.kind, name=fit.kind, options=options)


def split_of(pushes: PushSet, fit: Fit) -> Split:
    """Training and test rows of the fit."""
    if fit.split == "none":
        rows = np.random.default_rng(fit.seed).permutation(len(pushes.table))
        return Split(rows, np.zeros(0, dtype=np.int64))
    return split_by_push(pushes.table, fit.seed) if fit.split == "push" else random_split(len(pushes.table), fit.seed)


def random_split(rows: int, seed: int) -> Split:
    """Test up to 1000 random rows, the same for every seed; windows of one push are in both sets."""
    order = np.random.default_rng(0).permutation(rows)
    tested = min(RANDOM_TEST_ROWS, int(RANDOM_TEST_SHARE * rows))
    return Split(np.random.default_rng(RANDOM_TEST_ROWS + seed).permutation(order[tested:]), order[:tested])
