# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The joint fit: exact sizes, the weights of windows and pushes, and what training rows take away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_traces import DRIFT, JUMP, planted, pushes
from synthetic import noisy_pushes, square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint_shift
from push_predictor.models.mechanics.prior import CORRELATION
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import concatenate
from push_predictor.residuals.candidates.candidate import Candidate, candidate
from push_predictor.residuals.candidates.joint_fit import RIDGE, Fit, FitRows, _blocks, estimated, fitted
from push_predictor.residuals.evidence.inputs_basis import inputs_basis
from push_predictor.residuals.evidence.standardised import Evidence, evidence_of

ALWAYS = DriverBasis("constant")
LATER = planted("contact_friction", "elapsed_time", JUMP, 0.5)
CONSTANT = planted("contact_friction", "model_inputs", ALWAYS, 0.1)
OFF_CENTRE = planted("centre_of_friction", "model_inputs", ALWAYS, 0.012, -0.006)


@pytest.fixture(scope="module")
def deployed() -> PushModel:
    return train_model(pushes(60, 1), square_rig(), "analytical", name="deployed")


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


def test_large_effects_together_are_within_their_intervals_with_noise(deployed: PushModel) -> None:
    fit = fit_of(with_effects(evidence_of(deployed, pushes(60, 2)), LATER, OFF_CENTRE), LATER, OFF_CENTRE)
    assert np.all(np.abs(fit.coefficients - [0.5, 0.012, -0.006]) < 3.0 * deviations(fit))
    assert np.all(deviations(fit) < [0.05, 0.001, 0.001])


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
    away = []
    for seed in range(100, 160):
        fit = fit_of(with_effects(evidence_of(deployed, pushes(40, seed)), drift, grain), drift, grain)
        away.append((fit.coefficients - [0.15, 0.1]) / deviations(fit))
    assert np.mean(np.abs(away) < 2.02) > 0.90  # of Student's t with 39 degrees of freedom; 120 draws
    assert 0.8 < np.sqrt(np.mean(np.square(away))) < 1.25


def test_covariance_of_two_effects_is_shared(deployed: PushModel) -> None:
    """Nearly the same effect twice: the difference is uncertain, the sum is not."""
    same = planted("contact_friction", "elapsed_time", replace(JUMP, place=640.0), 0.0)
    fit = fit_of(with_effects(evidence_of(deployed, pushes(60, 2)), LATER), LATER, same)
    (one, other), cross = estimated(fit)
    sum_of = one.covariance + other.covariance + 2.0 * cross[0, 1]
    assert sum_of[0, 0] < 0.5 * one.covariance[0, 0]
