# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The joint fit: exact sizes, weights, what training rows take away, and scores of pushes that it was not fitted to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_traces import DRIFT, JUMP, NOISE, planted, pushes, slippery
from scipy.stats import multivariate_t
from synthetic import noisy_pushes, square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanics.prior import CORRELATION
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import concatenate
from push_predictor.residuals.candidates.candidate import Candidate, candidate
from push_predictor.residuals.candidates.joint_fit import (
    DEGREES,
    FOLDS,
    RIDGE,
    Fit,
    FitRows,
    _blocks,
    estimated,
    fitted,
    standard_error,
)
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.residualizer import sums_by
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of

ALWAYS = DriverBasis("constant")
LATER = planted("contact_friction", "elapsed_time", JUMP, 0.5)
CONSTANT = planted("contact_friction", "model_inputs", ALWAYS, 0.1)
OFF_CENTRE = planted("centre_of_friction", "model_inputs", ALWAYS, 0.012, -0.006)


def candidates(evidence: Evidence, *effects: Effect) -> list[Candidate]:
    return [candidate(evidence, e.mechanism, e.covariate, e.basis) for e in effects]


def with_effects(evidence: Evidence, *effects: Effect, noise: float = 1.0) -> Evidence:
    """The evidence with effects, and with this share of its noise."""
    shift = joint_shift(evidence.mechanics, effects, evidence.push)
    return replace(evidence, residual=noise * evidence.residual + shift)


def fit_of(evidence: Evidence, *effects: Effect) -> Fit:
    return fitted(FitRows(evidence), candidates(evidence, *effects))


def deviations(fit: Fit) -> np.ndarray:
    return np.sqrt(np.concatenate([np.diag(effect.covariance) for effect in estimated(fit)[0]]))


# --- coefficients ----------------------------------------------------------------------------------------------------


def test_large_effects_are_exact_with_little_noise(deployed: PushModel) -> None:
    """But for the ridge, which shrinks them by a thousandth."""
    quiet = evidence_of(deployed, pushes(60, 2))
    alone = fit_of(with_effects(quiet, LATER, noise=0.03), LATER).coefficients
    both = fit_of(with_effects(quiet, LATER, OFF_CENTRE, noise=0.03), LATER, OFF_CENTRE).coefficients
    assert alone == pytest.approx([0.5], rel=3.0 * RIDGE)
    assert both == pytest.approx([0.5, 0.012, -0.006], rel=4.0 * RIDGE)


@pytest.mark.parametrize("begin", [-0.2, 0.1, 0.7])
def test_the_same_solution_is_found_from_far_away(deployed: PushModel, begin: float) -> None:
    """A step that is too long is halved, and one that is too short doubled."""
    evidence = with_effects(evidence_of(deployed, pushes(60, 2)), LATER)
    near, far = (fitted(FitRows(evidence), candidates(evidence, LATER), start) for start in ([], [np.array([begin])]))
    assert abs(far.coefficients[0] - near.coefficients[0]) < 0.5 * deviations(near)[0]


def test_two_columns_that_are_the_same_share_the_effect(deployed: PushModel) -> None:
    evidence = with_effects(evidence_of(deployed, pushes(60, 2)), LATER)
    one, two = fit_of(evidence, LATER), fit_of(evidence, LATER, LATER)
    np.testing.assert_allclose(two.coefficients, one.coefficients[0] / 2.0, rtol=0.01)


def test_fit_without_effects_has_the_residuals_as_they_are(deployed: PushModel) -> None:
    evidence = evidence_of(deployed, pushes(60, 2))
    fit = fitted(FitRows(evidence), [])
    assert not fit.shift.any() and fit.coefficients.shape == (0,)
    assert fit.weighted.scale == pytest.approx(evidence.z.std(axis=0), rel=0.2)
    assert estimated(fit) == ((), {})


def test_effects_that_the_model_has_already_are_not_found_again(deployed: PushModel) -> None:
    """The new effect is the change from the mechanics as they are with those."""
    plain = evidence_of(deployed, pushes(60, 2))
    both, one = (joint_shift(plain.mechanics, effects, plain.push) for effects in ([OFF_CENTRE, LATER], [OFF_CENTRE]))
    had = replace(plain, residual=0.03 * plain.residual + both - one, effects=(OFF_CENTRE,))
    assert fit_of(had, LATER).coefficients == pytest.approx([0.5], rel=3.0 * RIDGE)


# --- weights ---------------------------------------------------------------------------------------------------------


def test_one_window_far_off_moves_little(deployed: PushModel) -> None:
    evidence = with_effects(evidence_of(deployed, pushes(60, 2)), LATER)
    slipped = evidence.residual.copy()
    slipped[150] += np.linalg.solve(evidence.whitener[150], np.full(3, 50.0))
    before, after = (fit_of(e, LATER) for e in (evidence, replace(evidence, residual=slipped)))
    assert abs(after.coefficients[0] - before.coefficients[0]) < 0.5 * deviations(before)[0]
    assert after.weighted.weight[150] < 0.01 * np.median(after.weighted.weight)
    assert after.weighted.scale == pytest.approx(before.weighted.scale, rel=0.1)


@pytest.mark.parametrize("copies", [2, 5])
def test_windows_of_a_push_share_their_weight(deployed: PushModel, copies: int) -> None:
    whole = evidence_of(deployed, pushes(60, 2))
    single = with_effects(whole.take(np.arange(0, 180, 3)), LATER)
    often = single.take(np.repeat(np.arange(60), copies))
    one, other = (fit_of(e, LATER) for e in (single, often))
    np.testing.assert_allclose(other.coefficients, one.coefficients, rtol=1e-6)
    information = [float(np.sum(fit.clear_columns**2)) for fit in (one, other)]
    assert information[1] / information[0] == pytest.approx(copies / (1.0 + (copies - 1.0) * CORRELATION))


# --- training under new windows ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def stacked() -> tuple[FitRows, FitRows]:
    """New windows over those of training of a learnt model, with the same error; and the new ones alone.

    The error is a function of the inputs, and as near to another contact friction as one can be.
    """
    model = train_model(noisy_pushes(60), square_rig(), "gp", name="learnt", options=TrainingOptions(mean="zero"))
    new, before = (evidence_of(model, pushes(80, seed)) for seed in (3, 4))
    controls = inputs_basis(model, concatenate([new.table, before.table])).columns
    friction = np.vstack([0.1 * candidates(e, CONSTANT)[0].plain[:, :, 0] for e in (new, before)])
    error = controls @ np.linalg.lstsq(controls, friction, rcond=None)[0]
    z = error + np.random.default_rng(0).normal(size=error.shape)
    new, before = _standardised(new, z[: len(new.table)]), _standardised(before, z[len(new.table) :])
    return FitRows(new, before, controls), FitRows(new)


def _standardised(evidence: Evidence, z: np.ndarray) -> Evidence:
    """The evidence with these standardised residuals (n, 3)."""
    return replace(evidence, residual=np.linalg.solve(evidence.whitener, z[:, :, None])[:, :, 0])


def test_error_of_the_inputs_in_both_is_no_effect(stacked: tuple[FitRows, FitRows]) -> None:
    both, new = (fitted(rows, candidates(rows.evidence, CONSTANT)) for rows in stacked)
    assert abs(both.coefficients[0]) < 3.0 * deviations(both)[0]
    assert abs(new.coefficients[0]) > 10.0 * deviations(new)[0]


def test_an_error_that_the_controls_express_is_removed_whatever_the_weights(stacked: tuple[FitRows, FitRows]) -> None:
    rows = stacked[0]
    uneven = replace(fitted(rows, []).weighted, weight=np.random.default_rng(1).uniform(0.01, 1.0, len(rows.z)))
    error = np.outer(rows.controls @ np.ones(rows.controls.shape[1]), [1.0, -2.0, 0.5])
    expressed = replace(rows, evidence=_standardised(rows.evidence, error[: len(rows.evidence.table)]))
    assert rows.training is not None
    expressed = replace(expressed, training=_standardised(rows.training, error[len(rows.evidence.table) :]))
    assert np.abs(uneven.clear(expressed.z)).max() < 1e-9 * np.abs(error).max()


def test_change_since_training_is_kept(stacked: tuple[FitRows, FitRows]) -> None:
    more = planted("contact_friction", "model_inputs", ALWAYS, 0.2)
    rows = replace(stacked[0], evidence=with_effects(stacked[0].evidence, more))
    fit = fitted(rows, candidates(rows.evidence, more))
    assert fit.coefficients[0] == pytest.approx(0.2, abs=3.0 * deviations(fit)[0])
    assert deviations(fit)[0] < 0.03


def test_pushes_of_training_are_blocks_of_their_own(stacked: tuple[FitRows, FitRows]) -> None:
    rows = stacked[0]
    assert len(np.unique(_blocks(rows, rows.block))) == 80 + 80


# --- covariance ------------------------------------------------------------------------------------------------------


def test_intervals_cover_in_repeated_draws(deployed: PushModel) -> None:
    """40 pushes with half of their noise in common: 95 % of the intervals contain the truth."""
    drift, grain = (
        planted("contact_friction", "elapsed_time", DRIFT, 0.15),
        planted("pressure_spread", "x", ALWAYS, 0.1),
    )
    exact = with_effects(evidence_of(deployed, pushes(40, 100)), drift, grain, noise=0.0)
    sought, rng, away = candidates(exact, drift, grain), np.random.default_rng(100), []
    for _ in range(40):
        noise = NOISE * (0.5 * rng.standard_normal((40, 3)).repeat(3, axis=0) + rng.standard_normal((120, 3)))
        fit = fitted(FitRows(replace(exact, residual=exact.residual + noise)), sought)
        away.append((fit.coefficients - [0.15, 0.1]) / deviations(fit))
    assert np.mean(np.abs(away) < 2.02) > 0.90  # of Student's t with 39 degrees of freedom; 80 draws
    assert 0.8 < np.sqrt(np.mean(np.square(away))) < 1.25


def test_covariance_of_two_effects_is_shared(deployed: PushModel) -> None:
    """Nearly the same effect twice: the difference is uncertain, the sum is not."""
    same = planted("contact_friction", "elapsed_time", replace(JUMP, place=640.0), 0.0)
    fit = fit_of(with_effects(evidence_of(deployed, pushes(60, 2)), LATER), LATER, same)
    (one, other), cross = estimated(fit)
    sum_of = one.covariance + other.covariance + 2.0 * cross[0, 1]
    assert sum_of[0, 0] < 0.5 * one.covariance[0, 0]


# --- scores -----------------------------------------------------------------------------------------------------------


def fit_along(evidence: Evidence, *mechanisms: str | None) -> Fit:
    """The fit of effects along the elapsed time."""
    return fitted(FitRows(evidence), [candidate(evidence, name, "elapsed_time", DRIFT) for name in mechanisms])


def refitted_scores(fit: Fit) -> np.ndarray:
    """Score of each block by a fit of a generic effect from the beginning to the rows of the other folds."""
    evidence, share, root = fit.rows.evidence, fit.rows.share, fit.weighted.root
    flat, target = root[:, :, None] * fit.columns, root * evidence.z
    ridge = np.diag(RIDGE * np.sum(flat**2, axis=(0, 1)) + 1.0)  # a normal prior of its unit besides
    left = np.zeros_like(target)
    for fold in range(FOLDS):
        out = fit.rows.block % FOLDS == fold
        x, y = flat[~out].reshape(-1, flat.shape[2]), target[~out].ravel()
        left[out] = evidence.z[out] - fit.columns[out] @ np.linalg.solve(x.T @ x + ridge, x.T @ y)
    unit = np.sqrt(np.average(left**2 * (fit.weighted.weight / share)[:, None], axis=0, weights=share))
    density = multivariate_t(np.zeros(3), np.diag(unit**2), DEGREES)
    constant = multivariate_t(np.zeros(3), np.eye(3), DEGREES).logpdf(np.zeros(3))
    return sums_by(fit.rows.block, (share * (density.logpdf(left) - constant))[:, None])[:, 0]


def test_scores_are_those_of_a_refit_without_each_fold(deployed: PushModel) -> None:
    unknown = planted(None, "elapsed_time", DRIFT, *np.linspace(-1.0, 1.0, 18))
    evidence = evidence_of(deployed, pushes(60, 2))
    design = candidate(evidence, None, "elapsed_time", DRIFT).plain
    moved = np.linalg.solve(evidence.whitener, (design @ unknown.coefficients)[:, :, None])[:, :, 0]
    fit = fit_along(replace(evidence, residual=evidence.residual + moved), None)
    np.testing.assert_allclose(fit.scores, refitted_scores(fit), rtol=1e-3, atol=1e-3)
    assert len(fit.scores) == 60


def test_scores_of_an_exact_effect_are_those_of_a_refit_without_each_fold(deployed: PushModel) -> None:
    """One Gauss-Newton step from the fit of all is near the exact fit without a fold."""
    evidence = evidence_of(deployed, pushes(60, 2, slippery(0.1)))
    fit = fit_along(evidence, "contact_friction")
    left = evidence.z - fit.shift
    for fold in range(FOLDS):
        out = fit.rows.block % FOLDS == fold
        again = fit_along(evidence.take(~out), "contact_friction")
        left[out] -= (fit.columns @ (again.coefficients - fit.coefficients))[out]
    share = fit.rows.share
    unit = np.sqrt(np.average(left**2 * (fit.weighted.weight / share)[:, None], axis=0, weights=share))
    expected = -0.5 * (DEGREES + 3.0) * np.log1p(np.sum((left / unit) ** 2, axis=1) / DEGREES) - np.log(unit).sum()
    assert fit.scores.sum() == pytest.approx(float(share @ expected), abs=0.3)


@pytest.mark.parametrize("covariate", ["elapsed_time", "slider_x"])
def test_gain_to_first_order_is_that_of_a_fit_with_the_columns(deployed: PushModel, covariate: str) -> None:
    """Of a small effect of either sort, next to another."""
    evidence = evidence_of(deployed, pushes(100, 2, slippery(0.05)))
    base = fit_along(evidence, "pressure_spread")
    basis = replace(
        DRIFT, drivers=(covariate,), centre=(0.0,), scale=(float(evidence.table.covariates[covariate].std()),)
    )
    for mechanism in (None, "contact_friction"):
        more = candidate(evidence, mechanism, covariate, basis)
        both = fitted(FitRows(evidence), [candidate(evidence, "pressure_spread", "elapsed_time", DRIFT), more])
        expected = float((both.scores - base.scores).sum())
        assert float((base.with_columns(more.plain) - base.scores).sum()) == pytest.approx(expected, rel=0.15, abs=3.0)


def test_an_effect_that_acts_gains_and_one_that_does_not_loses(deployed: PushModel) -> None:
    """Eighteen coefficients fit the noise of any pushes, but not that of others."""
    acting, idle = [], []
    for seed in range(2, 8):
        for found, table in ((acting, pushes(60, seed, slippery(0.1))), (idle, pushes(60, seed))):
            evidence = evidence_of(deployed, table)
            found.append(float((fit_along(evidence, None).scores - fit_along(evidence).scores).sum()))
    assert min(acting) > 20.0
    assert np.mean(idle) < 0.0


def test_standard_error_is_that_of_a_sum_of_independent_blocks() -> None:
    sums = np.random.default_rng(0).normal(0.3, 2.0, (400, 50)).sum(axis=1)
    gains = np.random.default_rng(1).normal(0.3, 2.0, 5000)
    assert standard_error(gains) == pytest.approx(10.0 * sums.std(), rel=0.1)
