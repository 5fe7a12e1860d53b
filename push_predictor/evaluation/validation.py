# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Compare predictions with observed pushes: the scores that evaluate, validate and push_validator report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from push_predictor.evaluation.metrics import (
    COVERAGE_LEVELS,
    coverage,
    gaussian_nlpd,
    joint_nlpd,
    nmse,
    standardised,
)
from push_predictor.evaluation.push_scores import push_scores
from push_predictor.models.mechanics.fitted import analytical_mechanics
from push_predictor.models.predictors.tails import IntervalKind, Tails, half_widths, joint_radius
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import OUTPUTS, PushTable
from push_predictor.recordings.windows.push_window import TIMED_ID
from push_predictor.types import Array, BoolArray

FIRST_DATE = 10**9  # s since 1970: in 2001


@dataclass(frozen=True, eq=False)
class Comparison:
    """Predictions and observations of n windows.

    mean, observed (n, 3); covariance (n, 3, 3); exact_log_density (n, 3), None where the predictive is Gaussian;
    push_id (n,); training_mean (3,), the reference of the NMSE; tails: of the predictive distribution, None for a
    Gaussian. textbook (n, 3): what mechanics with textbook parameters predicts, None if it was not computed.
    """

    model: str
    n_train: int
    push_id: np.ndarray
    mean: Array
    covariance: Array
    observed: Array
    exact_log_density: Array | None
    training_mean: Array
    tails: Tails | None = None
    textbook: Array | None = None

    @property
    def variance(self) -> Array:
        """Predicted variances (n, 3)."""
        return np.asarray(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def residuals(self) -> Array:
        """Residuals (n, 3) in predicted standard deviations."""
        return np.asarray((self.observed - self.mean) / np.sqrt(self.variance))

    def covered(self, levels: Sequence[float] | Array, kind: IntervalKind = "student") -> BoolArray:
        """Whether each outcome lies in its central interval, (n, 3, levels)."""
        half = np.stack([half_widths(self.tails, float(level), kind) for level in levels], axis=-1)
        return np.asarray(np.abs(self.residuals)[..., None] <= half)

    def joint_covered(self, levels: Sequence[float]) -> BoolArray:
        """Whether each outcome lies in the joint region of the three outputs, (n, levels)."""
        away = np.linalg.norm(standardised(self.mean, self.covariance, self.observed), axis=1)
        return np.asarray(away[:, None] <= [joint_radius(self.tails, level) for level in levels])


def compare(model: PushModel, table: PushTable) -> Comparison:
    """Predict every row of a table; the caller has checked it with `check_pushes`."""
    prediction = model.predict_rows(table.inputs, table.duration, table.covariates)
    return comparison_of(model, table, prediction.mean, prediction.covariance)


def comparison_of(model: PushModel, table: PushTable, mean: Array, covariance: Array) -> Comparison:
    """Combine given predictions (n, 3), (n, 3, 3), for instance from a service, with a table's outcomes."""
    moments = comparison_of_moments(model, table, mean, covariance)
    textbook = analytical_mechanics(model.rig.outline, model.rig.pusher_radius)
    return replace(
        moments,
        exact_log_density=model.exact_log_density(table),
        textbook=textbook.displacement(table.inputs, table.duration),
    )


def comparison_of_moments(model: PushModel, table: PushTable, mean: Array, covariance: Array) -> Comparison:
    """The same without the exact density, which takes most of the time."""
    return Comparison(
        model.name,
        len(model.training),
        table.push_id,
        mean,
        covariance,
        table.outcomes,
        None,
        model.training_mean,
        model.predictor.tails,
    )


def metrics_json(comparison: Comparison) -> dict[str, object]:
    """The scores of docs/reference/json.md, with 95 % intervals of the totals from resampling whole pushes.

    A number that these windows do not determine is None.
    """
    c = comparison
    count, nothing = len(c.observed), np.full(3, np.nan)
    nlpd = gaussian_nlpd(c.mean, c.variance, c.observed)
    exact = None if c.exact_log_density is None else _named(-_mean(c.exact_log_density))
    return {
        "model": c.model,
        "n_train": c.n_train,
        "n_test": count,
        "n_pushes": len(set(c.push_id.tolist())),
        "nmse": _named(nmse(c.mean, c.observed, c.training_mean) if count else nothing),
        "nlpd": _named(_mean(nlpd)),
        "exact_nlpd": exact,
        "joint_nlpd": _number(np.mean(joint_nlpd(c.mean, c.covariance, c.observed))) if count else None,
        "coverage": {str(level): _coverage(c, level) if count else None for level in COVERAGE_LEVELS},
        "joint_coverage": _joint_coverage(c),
        "interval": _intervals(c),
        "textbook": _textbook(c),
    }


def pit(comparison: Comparison) -> Array:
    """Probability integral transform (n, 3): the predicted probability of an outcome below the observed one."""
    tails, residuals = comparison.tails, comparison.residuals
    return np.asarray(scipy.special.ndtr(residuals)) if tails is None else tails.probability(residuals)


def trained_on(model: PushModel, table: PushTable) -> list[str]:
    """The pushes of a table that were used to train the model: scores on them are optimistic.

    These are the pushes with a training window, and those that began at the time of a training push: after a correction
    of the streams its windows differ. A clock that begins at zero gives the same time to pushes of other days.
    """
    known = {row.tobytes() for row in np.column_stack([model.training.inputs, model.training.outcomes])}
    rows = np.column_stack([table.inputs, table.outcomes])
    same_rows = {push for push, row in zip(table.push_id.tolist(), rows, strict=True) if row.tobytes() in known}
    begun = {_timed(push) for push in model.training.pushes} - {None}
    return sorted(same_rows | {push for push in table.pushes if _timed(push) in begun})


def _timed(push_id: str) -> str | None:
    """The part of an id with the date and time of first contact; None for other ids, and for a clock without dates."""
    name = push_id.rpartition("/")[2]
    seconds = name.removeprefix(TIMED_ID).partition(".")[0]
    return name if name.startswith(TIMED_ID) and seconds.isdecimal() and int(seconds) >= FIRST_DATE else None


def _intervals(c: Comparison) -> dict[str, object]:
    draws = push_scores(c).resampled()
    nmse_draws, nlpd_draws = draws.nmse.sum(axis=1), draws.nlpd.sum(axis=1)
    return {"level": 0.95, "by": "push", "nmse": _interval(nmse_draws), "nlpd": _interval(nlpd_draws)}


def _textbook(c: Comparison) -> dict[str, object] | None:
    """The NMSE of mechanics with textbook parameters, and the model's minus it, with a 95 % interval over pushes."""
    if c.textbook is None or not len(c.observed):
        return None
    scores = nmse(c.textbook, c.observed, c.training_mean)
    own = nmse(c.mean, c.observed, c.training_mean)
    draws = [push_scores(each).resampled().nmse.sum(axis=1) for each in (c, replace(c, mean=c.textbook))]
    interval = _interval(draws[0] - draws[1]) or {"low": None, "high": None}
    return {"nmse": _named(scores), "difference": {"value": _number(np.sum(own) - np.sum(scores)), **interval}}


def _interval(draws: Array) -> dict[str, float | None] | None:
    if not len(draws):
        return None
    low, high = np.quantile(draws, [0.025, 0.975])
    return {"low": _number(low), "high": _number(high)}


def _coverage(c: Comparison, level: float) -> dict[str, float | None]:
    shares = coverage(c.mean, c.variance, c.observed, half_widths(c.tails, level))
    return {name: _number(share) for name, share in zip(OUTPUTS, shares, strict=True)}


def _joint_coverage(c: Comparison) -> dict[str, float | None]:
    inside = c.joint_covered(COVERAGE_LEVELS)
    return {
        str(level): _number(np.mean(column)) if len(column) else None
        for level, column in zip(COVERAGE_LEVELS, inside.T, strict=True)
    }


def _named(values: Array) -> dict[str, float | None]:
    return {
        **{name: _number(value) for name, value in zip(OUTPUTS, values, strict=True)},
        "total": _number(np.sum(values)),
    }


def _mean(rows: Array) -> Array:
    return np.mean(rows, axis=0) if len(rows) else np.full(rows.shape[1], np.nan)


def _number(value: float | np.floating) -> float | None:
    return float(value) if np.isfinite(value) else None
