# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The scores of a push that the alarm tests, and those of the training pushes for comparison.

A training push is scored by cross-validation. A learnt model is refitted on each half of its pushes, hyperparameters
included, and scores the other half: hyperparameters that have seen a push make its residuals some per cent smaller than
those of a new push, and a test that adds up evidence over hundreds of pushes takes that for a change. A model of half
the pushes makes slightly larger errors than the whole model, so the alarm errs on the safe side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_predictor.errors import RequestError, TrainingError
from push_predictor.evaluation.alarm.evidence import (
    DEFAULT_RATE,
    SIZE,
    Alarm,
    AlarmState,
    ScoreKind,
    alarm_json,
    checked_rate,
)
from push_predictor.evaluation.metrics import standardised, whitener_of
from push_predictor.evaluation.splits import push_folds
from push_predictor.evaluation.validation import Comparison
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanisms import LIBRARY, Mechanism
from push_predictor.models.predictors import Moments
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.train import retrain_model
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.types import Array, IntArray
from push_predictor.watch import Watch, no_watch, watched

FOLDS = 2
FEWEST_PUSHES = 10  # calibration pushes; with fewer even hundreds of pushes give no evidence
MEAN_SIZE = 0.9247  # mean of the cube root of the mean of three squared standard normals
SIZE_WEIGHT, OUTPUT_WEIGHT = 0.3, 0.2  # shares of the false-alarm rate; the mechanisms share the rest


@dataclass(frozen=True, eq=False)
class Calibration:
    """The scores of a model's training pushes, to which the alarm compares new pushes.

    kinds (k,) and scores (n, k) of the n training pushes. mechanisms: those of the library that can be computed from
    the training windows. window_correlation (k,): correlation of each score's terms between windows of a push.
    """

    kinds: tuple[ScoreKind, ...]
    scores: Array
    mechanisms: tuple[Mechanism, ...]
    mechanics: FittedMechanics
    window_correlation: Array


class AlarmMonitor:
    """The alarm of one model, fed with windows and their predictions push by push.

    A push that was counted before, for instance in a repeated replay, is ignored. skipped: pushes that cannot be
    scored, with the reason. Raises RequestError for a rate outside (0, 1).
    """

    def __init__(self, calibration: Calibration, rate: float = DEFAULT_RATE, seed: int = 0) -> None:
        self._calibration = calibration
        self._alarm = Alarm(calibration.kinds, calibration.scores, rate, seed)
        self._seen: set[str] = set()
        self.skipped: list[str] = []

    def add(self, windows: PushTable, mean: Array, covariance: Array) -> str | None:
        """Add whole pushes with predicted mean (n, 3) and covariance (n, 3, 3); return the push at which it fires."""
        fired = None
        scores = _scores_by_push(self._calibration, windows, mean, covariance)
        for push in windows.pushes:
            if push not in self._seen and self._counted(push, scores[push]):
                fired = push
        return fired

    def _counted(self, push: str, scores: Array) -> bool:
        self._seen.add(push)
        try:
            return self._alarm.add(push, scores)
        except RequestError as error:
            self.skipped.append(f"push {push}: {error}")
            return False

    @property
    def state(self) -> AlarmState:
        """The state of the alarm after all pushes so far."""
        return self._alarm.state


def alarm_state(
    calibration: Calibration, windows: PushTable, mean: Array, covariance: Array, rate: float = DEFAULT_RATE
) -> AlarmState:
    """The state of the alarm after all pushes of a table in row order, as push_validator reports it."""
    monitor = AlarmMonitor(calibration, rate)
    monitor.add(windows, mean, covariance)
    return monitor.state


def recording_alarm(
    model: PushModel,
    windows: PushTable,
    comparison: Comparison,
    rate: float = DEFAULT_RATE,
    watch: Watch = no_watch,
) -> dict[str, object]:
    """The field `alarm` of the JSON of `validate`; watch: as in `calibrate`.

    Raises RequestError for a rate outside (0, 1).
    """
    checked_rate(rate)
    try:
        calibration = calibrate(model, watch)
    except RequestError as error:
        return alarm_json(None, str(error))
    return alarm_json(alarm_state(calibration, windows, comparison.mean, comparison.covariance, rate))


def calibrate(model: PushModel, watch: Watch = no_watch) -> Calibration:
    """Score a model's training pushes by cross-validation. Raises RequestError for fewer than FEWEST_PUSHES.

    watch: called before each refit of the model.
    """
    table = model.training
    if len(table.pushes) < FEWEST_PUSHES:
        raise RequestError("training pushes of the model", len(table.pushes), f"at least {FEWEST_PUSHES}")
    mean, covariance = held_out_moments(model, watch)
    mechanisms = tuple(mechanism for mechanism in LIBRARY if _computable(mechanism, table))
    blank = Calibration(_kinds(mechanisms), np.empty((0, 0)), mechanisms, model.base.predictor.mechanics, np.empty(0))
    rows = [np.flatnonzero(table.push_id == push) for push in table.pushes]
    parts = _parts(blank, table, mean, covariance)
    known = replace(blank, window_correlation=np.array([_window_correlation(*part, rows) for part in parts]))
    return replace(known, scores=np.array([_scores(known, [(a[r], b[r]) for a, b in parts]) for r in rows]))


def held_out_moments(model: PushModel, watch: Watch = no_watch) -> tuple[Array, Array]:
    """Mean (n, 3) and covariance (n, 3, 3) for the training windows, by the model without their half of the pushes.

    Effects are kept, and so are models that are not learnt: they have few parameters. Hyperparameters are kept where
    half the rows are too few to refit them.
    """
    predictor, rows, folds = model.predictor, model.training, push_folds(model.training, FOLDS)
    push = Push.of(rows)
    of_base = replace(rows, outcomes=rows.outcomes - predictor.shift(push).mean)
    base = _by_refits(model.base, of_base, folds, watch) if predictor.learnt else None
    moments = model.held_out_moments(folds) if base is None else predictor.with_effects(base, push)
    return moments.mean, moments.covariance


def _by_refits(base: PushModel, rows: PushTable, folds: IntArray, watch: Watch) -> Moments | None:
    """Moments at the rows by the base refitted on those of the other folds; None where these are too few."""
    found = Moments(*(np.empty((len(rows), *shape)) for shape in ((3,), (3, 3), (3, 3))))
    for fold in watched(range(FOLDS), watch, "alarm: refit"):
        own = folds == fold
        try:
            model = retrain_model(base, rows.take(np.flatnonzero(~own)))
        except TrainingError:
            return None
        part = rows.take(np.flatnonzero(own))
        moments = model.predictor.moments(Push.of(part))
        for whole, values in zip(found, moments, strict=True):
            whole[own] = values
    return found


def _scores_by_push(calibration: Calibration, windows: PushTable, mean: Array, covariance: Array) -> dict[str, Array]:
    """Scores (k,) of each push, NaN if a covariate is missing.

    Pushes are scored together, which takes little longer than for one. Pushes with long windows are scored one by one:
    the longest window sets the integration step, and a score must not depend on other pushes.
    """
    found: dict[str, Array] = {}
    parts = _parts(calibration, windows, mean, covariance)
    for push in windows.pushes:
        own = windows.push_id == push
        found[push] = _scores(calibration, [(along[own], reach[own]) for along, reach in parts])
    return found


def _computable(mechanism: Mechanism, table: PushTable) -> bool:
    return all(name in table.covariates and np.all(np.isfinite(table.covariates[name])) for name in mechanism.needs)


def _kinds(mechanisms: Sequence[Mechanism]) -> tuple[ScoreKind, ...]:
    outputs = [f"{name}{side}" for side in ("", " times the sign of the push angle") for name in OUTPUTS]
    named = [f"{m.name}: {parameter.name}" for m in mechanisms for parameter in m.parameters]
    share = (1.0 - SIZE_WEIGHT - OUTPUT_WEIGHT) / max(len(named), 1)
    rest = [ScoreKind(name, OUTPUT_WEIGHT / len(outputs), True) for name in outputs]
    return (ScoreKind(SIZE, SIZE_WEIGHT, False), *rest, *(ScoreKind(name, share, True) for name in named))


def _parts(calibration: Calibration, table: PushTable, mean: Array, covariance: Array) -> list[tuple[Array, Array]]:
    """The terms of each score: the window's residual along its direction (n,), and that direction's norm (n,)."""
    z = standardised(mean, covariance, table.outcomes)
    size = np.cbrt(np.mean(z**2, axis=1)) - MEAN_SIZE  # nearly normal, so that the number of windows matters little
    side = np.sign(table.inputs[:, 2])
    generic = np.concatenate([np.eye(3)[None] * np.ones((len(z), 1, 1)), np.eye(3)[None] * side[:, None, None]], axis=2)
    whitener = whitener_of(covariance)
    unknown = {name: np.full(len(z), np.nan) for m in calibration.mechanisms for name in m.needs}
    push = Push(table.inputs, table.duration, {**unknown, **table.covariates})
    responses = [mechanism.response(calibration.mechanics, push) for mechanism in calibration.mechanisms]
    columns = np.concatenate([generic, *(whitener @ response for response in responses)], axis=2)
    along, reach = np.einsum("nkp,nk->np", columns, z), np.linalg.norm(columns, axis=1)
    return [(size, np.ones(len(z))), *zip(along.T, reach.T, strict=True)]


def _window_correlation(along: Array, reach: Array, rows: Sequence[np.ndarray]) -> float:
    """Correlation between windows of a push, by the method of moments; 0 if no push has two windows."""
    together = sum(float(along[r].sum() ** 2 - np.sum(along[r] ** 2)) for r in rows)
    pairs = sum(float(reach[r].sum() ** 2 - np.sum(reach[r] ** 2)) for r in rows)
    alone = float(np.sum(along**2)) / max(float(np.sum(reach**2)), np.finfo(float).tiny)
    return float(np.clip(together / pairs / alone, 0.0, 1.0)) if pairs > 0.0 and alone > 0.0 else 0.0


def _scores(calibration: Calibration, parts: Sequence[tuple[Array, Array]]) -> Array:
    """Scores of one push: the sum over its windows divided by the standard deviation of that sum."""
    scores = np.zeros(len(parts))
    for k, (along, reach) in enumerate(parts):
        square = float(np.sum(reach**2))
        spread = square + calibration.window_correlation[k] * (float(reach.sum()) ** 2 - square)
        scores[k] = 0.0 if spread == 0.0 else along.sum() / np.sqrt(spread)
    return scores
