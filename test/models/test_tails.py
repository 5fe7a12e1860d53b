# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Tails of learnt models: the fit, the intervals of both kinds, and what carries them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from learnt_models import learnt
from scipy import stats
from synthetic import noisy_pushes, square_rig

from push_predictor.errors import RequestError
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.predictors.tails import (
    FEWEST_PUSHES,
    INTERVAL_KINDS,
    STEPS,
    Tails,
    fit_tails,
    half_widths,
    joint_radius,
)
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

SCALE, DEGREES = np.array([0.5, 0.9, 1.6]), np.array([3.0, 4.0, 8.0])


def made_up(pushes: int = 40) -> Tails:
    quantiles = np.sort(np.random.default_rng(0).exponential(size=(STEPS, 3)), axis=0)
    return Tails(SCALE, DEGREES, 0.7, 5.0, pushes, quantiles)


def residuals_of(pushes: int, windows: int, seed: int = 0) -> tuple[Array, np.ndarray]:
    """Residuals of independent t distributed windows, and the push of each."""
    n = pushes * windows
    drawn = np.random.default_rng(seed).standard_t(DEGREES, size=(n, 3)) * SCALE
    return drawn, np.array([f"p{k // windows}" for k in range(n)])


def fitted(residuals: Array, push_ids: np.ndarray, counts: tuple[int, int, int] = (0, 0, 0)) -> Tails:
    tails = fit_tails(residuals, np.tile(np.eye(3), (len(residuals), 1, 1)), push_ids, counts)
    assert tails is not None
    return tails


def shared_errors(pushes: int, seed: int) -> PushTable:
    """Five windows a push; each push has its own size of error, which its windows share in part, of any path length."""
    table = noisy_pushes(5 * pushes, seed, windows_per_push=5)
    rng = np.random.default_rng([seed, 1])
    size = np.exp(0.6 * rng.standard_normal(pushes))
    own = rng.standard_normal((pushes, 3)) + 0.7 * rng.standard_normal((5, pushes, 3))
    error = (own * size[:, None]).transpose(1, 0, 2).reshape(-1, 3) * [2e-4, 2e-4, 5e-3]
    return replace(table, outcomes=table.outcomes + error)


@cache
def trained(kind: str = "gp") -> PushModel:
    options = TrainingOptions(mean="zero", per_path=False)
    return train_model(shared_errors(40, 0), square_rig(), kind, name=kind, options=options)


def tails_of(model: PushModel) -> Tails:
    assert model.predictor.tails is not None
    return model.predictor.tails


def untailed(model: PushModel) -> PushModel:
    return replace(model, predictor=replace(learnt(model), tails=None))


def predicted(model: PushModel, table: PushTable) -> Prediction:
    return model.predict_rows(table.inputs, table.duration, table.covariates)


# The distribution


def test_reported_standard_deviation_is_that_of_the_t_distribution() -> None:
    assert made_up().factor == pytest.approx(stats.t(DEGREES, scale=SCALE).std())


def test_density_and_probability_are_those_of_a_t_distribution_in_reported_units() -> None:
    tails, z = made_up(), np.random.default_rng(1).normal(size=(50, 3))
    expected = stats.t(DEGREES, scale=SCALE / tails.factor)
    assert tails.log_density(z) == pytest.approx(expected.logpdf(z))
    assert tails.probability(z) == pytest.approx(expected.cdf(z))


@given(st.floats(0.01, 0.999))
def test_student_interval_has_its_probability(level: float) -> None:
    half = made_up().half_width(level)
    assert 2.0 * made_up().probability(half[None])[0] - 1.0 == pytest.approx(np.full(3, level))


def test_without_tails_intervals_are_gaussian() -> None:
    assert half_widths(None, 0.95) == pytest.approx(np.full(3, stats.norm.ppf(0.975)))
    assert joint_radius(None, 0.95) == pytest.approx(np.sqrt(stats.chi2(3).ppf(0.95)))


def test_joint_region_has_its_probability() -> None:
    drawn = 0.7 * stats.multivariate_t(shape=np.eye(3), df=5.0, seed=0).rvs(40_000)
    inside = np.linalg.norm(drawn, axis=1) <= joint_radius(made_up(), 0.9)
    assert np.mean(inside) == pytest.approx(0.9, abs=0.006)
    of_two = np.linalg.norm(drawn[:, :2], axis=1) <= joint_radius(made_up(), 0.9, 2)
    assert np.mean(of_two) == pytest.approx(0.9, abs=0.006)
    assert joint_radius(None, 0.95, 2) == pytest.approx(np.sqrt(-2.0 * np.log(0.05)))


@pytest.mark.parametrize(
    ("tails", "level", "kind", "message"),
    [
        *((tails, level, "student", "level") for tails in (None, made_up()) for level in (0.0, 1.0, float("nan"))),
        (made_up(), 0.9, "bayes", r"interval.*bayes.*student or conformal"),
        (None, 0.9, "conformal", r"interval.*conformal"),
    ],
)
def test_other_levels_and_kinds_are_refused(tails: Tails | None, level: float, kind: Any, message: str) -> None:
    with pytest.raises(RequestError, match=message):
        half_widths(tails, level, kind)


# Conformal intervals


@given(st.integers(4, 60), st.floats(0.05, 0.95))
@settings(deadline=None, max_examples=25)
def test_conformal_interval_of_single_windows_is_the_order_statistic(pushes: int, level: float) -> None:
    """Of k exchangeable scores, the ceil(level (k + 1))-th smallest bounds a new one with probability level."""
    z, names = residuals_of(pushes, 1, pushes)
    tails, rank = fitted(z, names), int(np.ceil(level * (pushes + 1) - 1e-9))
    if rank > pushes:
        with pytest.raises(RequestError, match=f"level.*{pushes} training pushes"):
            tails.half_width(level, "conformal")
        return
    widths = np.sort(np.abs(z), axis=0)
    found = tails.half_width(level, "conformal") * tails.factor
    assert np.all(found >= widths[rank - 1] * (1.0 - 1e-9))
    assert np.all(found <= widths[min(rank + int(np.ceil(pushes / STEPS)), pushes) - 1] * (1.0 + 1e-9))


def test_every_push_counts_the_same_in_conformal_intervals() -> None:
    z, names = residuals_of(30, 1)
    many = np.concatenate([z, np.tile(1e-3 * np.ones(3), (300, 1))])  # one push with 300 windows of small residuals
    both = fitted(many, np.concatenate([names, np.full(300, "long")]))
    alone = np.sort(np.abs(z), axis=0)
    found = both.half_width(0.5, "conformal") * both.factor
    assert np.all(found >= alone[13]) and np.all(found <= alone[16])


# The fit


def test_fit_finds_scale_and_degrees_of_many_pushes() -> None:
    tails = fitted(*residuals_of(4000, 1))
    assert tails.scale == pytest.approx(SCALE, rel=0.06)
    assert tails.degrees == pytest.approx(DEGREES, rel=0.3)
    assert tails.pushes == 4000


def test_joint_region_is_fitted_under_the_correlation() -> None:
    covariance = np.array([[4.0, 1.9, 0.0], [1.9, 1.0, 0.0], [0.0, 0.0, 0.25]])
    root = np.linalg.cholesky(covariance)
    drawn = stats.multivariate_t(shape=np.eye(3), df=6.0, seed=0).rvs(6000) @ root.T
    names = np.array([f"p{k}" for k in range(4000)])
    tails = fit_tails(drawn[:4000], np.tile(covariance, (4000, 1, 1)), names, (0, 0, 0))
    assert tails is not None
    assert tails.joint_degrees == pytest.approx(6.0, rel=0.1)
    reported = covariance * np.outer(tails.factor, tails.factor)
    away = np.linalg.norm(np.linalg.solve(np.linalg.cholesky(reported), drawn[4000:].T), axis=0)
    assert np.mean(away <= tails.joint_radius(0.95)) == pytest.approx(0.95, abs=0.015)


def test_the_final_prediction_error_widens_and_windows_of_a_push_count_for_less_than_independent_ones() -> None:
    z, names = residuals_of(100, 1)
    together, counts = np.array([f"p{k // 10}" for k in range(100)]), np.array([4, 2, 0])
    for push, number in ((names, 100.0), (together, 100.0 / (1.0 + 0.45 * 9.0))):
        factor = fitted(z, push, tuple(counts)).factor / fitted(z, push).factor
        assert factor == pytest.approx(np.sqrt((number + counts) / (number - counts)), rel=1e-3)


def test_few_windows_have_about_the_usual_degrees() -> None:
    z, names = residuals_of(6, 1)
    assert np.all(np.abs(np.log((fitted(z, names).degrees - 2.0) / 2.0)) < 0.5)


def test_conformal_widths_are_also_widened_by_the_hyperparameters() -> None:
    z, names = residuals_of(50, 1)
    with_them, without = fitted(z, names, (10, 10, 10)), fitted(z, names)
    widths = [tails.half_width(0.8, "conformal") * tails.factor for tails in (with_them, without)]
    assert widths[0] / widths[1] == pytest.approx(np.full(3, np.sqrt(60.0 / 40.0)))


def test_too_few_pushes_and_constant_residuals_have_no_tails() -> None:
    z, names = residuals_of(FEWEST_PUSHES - 1, 20)
    unit = np.tile(np.eye(3), (len(z), 1, 1))
    assert fit_tails(z, unit, names, (0, 0, 0)) is None
    z, names = residuals_of(FEWEST_PUSHES, 20)
    unit = np.tile(np.eye(3), (len(z), 1, 1))
    assert fit_tails(z, unit, names, (0, 0, 0)) is not None
    assert fit_tails(z * [1.0, 0.0, 1.0], unit, names, (0, 0, 0)) is None


# In models


@pytest.mark.parametrize("kind", ["gp", pytest.param("vhgp", marks=pytest.mark.long)])
def test_intervals_cover_new_pushes_that_share_an_error(kind: str) -> None:
    model, test = trained(kind), shared_errors(400, 7)
    answer = predicted(model, test)
    for level in (0.5, 0.9, 0.95):
        for interval in INTERVAL_KINDS:
            low, high = answer.interval(level, interval)
            inside = (test.outcomes >= low) & (test.outcomes <= high)
            tolerance = 0.12 if level == 0.5 else 0.06  # of 40 training pushes
            assert inside.mean(axis=0) == pytest.approx(np.full(3, level), abs=tolerance)


@pytest.mark.parametrize("kind", ["gp", "vhgp"])
def test_density_of_new_pushes_is_better_with_tails(kind: str) -> None:
    test, model = shared_errors(400, 7), trained(kind)
    plain = untailed(model).exact_log_density(test)
    if plain is None:
        answer = predicted(untailed(model), test)
        plain = stats.norm(answer.mean, answer.std).logpdf(test.outcomes)
    with_tails = model.exact_log_density(test)
    assert with_tails is not None and with_tails.sum(axis=1).mean() > plain.sum(axis=1).mean() + 0.05


def test_covariances_are_those_of_the_regressions_times_the_factors() -> None:
    model, test = trained("gp"), shared_errors(5, 3)
    without = untailed(model)
    factor = np.outer(tails_of(model).factor, tails_of(model).factor)
    found, plain = predicted(model, test), predicted(without, test)
    assert found.covariance == pytest.approx(plain.covariance * factor)
    assert found.process_covariance == pytest.approx(plain.process_covariance * factor)
    assert found.mean == pytest.approx(plain.mean) and found.tails is tails_of(model) and plain.tails is None


@pytest.mark.parametrize("effects", [False, True])
def test_exact_density_is_the_t_density_of_the_reported_moments(effects: bool) -> None:
    model, test = trained("gp"), shared_errors(5, 3)
    if effects:  # they shift and widen it
        always, size = DriverBasis("constant"), (np.array([0.1]), np.array([[0.01]]))
        tip = Effect("contact_friction", "velocity", always, *size, np.ones(3))
        model = replace(model, predictor=ExtendedPredictor(learnt(model), (tip,), np.array([2.0, 1.0, 0.5])))
    tails, answer = tails_of(model), predicted(model, test)
    scale = answer.std * np.sqrt((tails.degrees - 2.0) / tails.degrees)
    expected = stats.t(tails.degrees, answer.mean, scale).logpdf(test.outcomes)
    assert model.exact_log_density(test) == pytest.approx(expected)
    assert answer.tails is tails is tails_of(trained("gp"))


def test_tails_come_from_held_out_pushes() -> None:
    """Of the model's own rows the residuals are smaller; an overfitted model must not be taken at its word."""
    model = trained("gp")
    rows, held = model.training, model.held_out_moments()
    tails = tails_of(model)
    z = (rows.outcomes - held.mean) / np.sqrt(np.diagonal(held.covariance, axis1=1, axis2=2))
    assert np.median(np.abs(z), axis=0) == pytest.approx(tails.half_width(0.5), rel=0.25)
    own = model.predictor.moments(Push(rows.inputs, rows.duration, {}))
    assert np.all(np.std(rows.outcomes - own.mean, axis=0) < np.std(rows.outcomes - held.mean, axis=0))


def test_informed_model_takes_the_residuals_of_mechanics_fitted_without_the_push() -> None:
    table = shared_errors(8, 2)
    model = train_model(table, square_rig(), "gp", name="a", options=TrainingOptions(mean="mechanics"))
    held = untailed(model).held_out_moments()
    counts = [regression.parameters.count for regression in learnt(model).regressions]
    own = fit_tails(table.outcomes - held.mean, held.covariance, table.push_id, counts)
    assert own is not None and np.prod(tails_of(model).factor) > 1.01 * np.prod(own.factor)
