# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""An extension counts only for what its mean brings, over the better of the models without it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from made_up_traces import planted, pushes, slippery
from synthetic import noisy_pushes, square_rig

from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.residuals.candidates.candidate import Candidate, candidate
from push_predictor.residuals.evidence.standardised import evidence_of
from push_predictor.residuals.extension.extended_model import by_the_clock, extend, refit_base, spread_rows
from push_predictor.residuals.extension.held_out_gain import (
    held_out_gain,
    held_out_windows,
    new_windows,
)
from push_predictor.residuals.outcome import Sized, size_of

CONSTANT = DriverBasis("constant")
ANALYSIS, HELD_OUT = (pushes(count, seed, slippery(0.0)) for count, seed in ((120, 3), (60, 4)))


def overconfident(model: PushModel, factor: float) -> PushModel:
    """The model with predicted deviations `factor` times as large."""
    predictor = ExtendedPredictor(model.predictor.base, (), np.full(3, factor))
    return replace(model, predictor=predictor)


def with_idle_effect(model: PushModel, variance: float) -> PushModel:
    """The model with an effect of size zero that is uncertain."""
    idle = replace(planted("contact_friction", "model_inputs", CONSTANT, 0.0), covariance=np.array([[variance]]))
    predictor = ExtendedPredictor(model.predictor.base, (idle,), scale_of(model))
    return replace(model, predictor=predictor)


def scale_of(model: PushModel) -> np.ndarray:
    """Factor (3,) on the base's deviations."""
    assert isinstance(model.predictor, ExtendedPredictor)
    return model.predictor.scale


@pytest.mark.parametrize("factor", [0.3, 1.0, 4.0])
def test_calibrated_deviations_fit_the_pushes_whatever_they_were(deployed: PushModel, factor: float) -> None:
    found = new_windows(overconfident(deployed, factor), ANALYSIS).calibrated()
    z = evidence_of(found, ANALYSIS).z
    assert np.mean(np.linalg.norm(z, axis=1) ** 2) == pytest.approx(3.0, rel=0.1)


def test_further_covariance_takes_its_share_of_the_calibrated_deviation(deployed: PushModel) -> None:
    plain = new_windows(deployed, ANALYSIS).calibrated()
    variance = np.diagonal(plain.predict_rows(ANALYSIS.inputs, ANALYSIS.duration).covariance, axis1=1, axis2=2)
    extra = 0.36 * np.stack([np.diag(row) for row in variance])
    narrower = new_windows(deployed, ANALYSIS).factor(extra)
    assert narrower == pytest.approx(0.8 * scale_of(plain), rel=1e-3)


def test_the_uncertainty_of_a_models_own_effects_is_not_scaled(deployed: PushModel) -> None:
    """Only the base's deviation is: with what the effects add, the whole fits the pushes."""
    found = new_windows(with_idle_effect(overconfident(deployed, 1.0), 0.01), ANALYSIS).calibrated()
    assert np.mean(np.sum(evidence_of(found, ANALYSIS).z ** 2, axis=1)) == pytest.approx(3.0, rel=0.2)
    assert np.all(scale_of(found) < scale_of(new_windows(deployed, ANALYSIS).calibrated()))


def test_scaled_predictions_are_those_of_the_model_with_scaled_deviations(deployed: PushModel) -> None:
    model = with_idle_effect(overconfident(deployed, 0.5), 0.01)
    unseen = new_windows(model, ANALYSIS)
    expected = new_windows(unseen.calibrated(), HELD_OUT)
    found = new_windows(model, HELD_OUT).scaled(unseen.factor())
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(found.mean, expected.mean)


def test_uncertainty_of_an_effect_of_zero_is_no_gain(deployed: PushModel) -> None:
    """Against an overconfident refit the widened interval alone would look like a gain."""
    refit = overconfident(deployed, 0.5)
    found = held_out_gain(refit, refit, with_idle_effect(refit, 0.05), ANALYSIS, HELD_OUT)
    assert found.nlpd.high > 0.0
    assert found.nmse.value == pytest.approx(0.0, abs=1e-12)


def test_a_real_effect_is_a_gain_over_both_models(deployed: PushModel) -> None:
    changed, later = pushes(120, 5, slippery(0.06)), pushes(60, 6, slippery(0.06))
    refit = refit_base(deployed, changed)
    linear = DriverBasis("linear", ("elapsed_time",), (0.0,), (1000.0,))
    after = extend(
        refit,
        evidence_of(deployed, changed),
        [candidate(evidence_of(deployed, changed), "contact_friction", "elapsed_time", linear)],
    )
    found = held_out_gain(deployed, refit, after, changed, later)
    assert found.nlpd.high < 0.0 and found.nmse.high < 0.0


def test_the_gain_is_over_the_better_model(deployed: PushModel) -> None:
    """A refit that is far off is no reference: what beats it need not beat the deployed model."""
    far_off = train_model(
        pushes(40, 7, slippery(0.6)), square_rig(), "gp", name="far off", options=TrainingOptions(mean="zero")
    )
    found = held_out_gain(deployed, far_off, with_idle_effect(overconfident(deployed, 1.0), 1e-6), ANALYSIS, HELD_OUT)
    assert found.reference == "deployed" and found.nlpd.high > -0.05
    turned = held_out_gain(far_off, deployed, with_idle_effect(overconfident(deployed, 1.0), 1e-6), ANALYSIS, HELD_OUT)
    assert turned.reference == "refit"


def test_held_out_calibration_does_not_take_the_fit_for_the_noise() -> None:
    model = train_model(noisy_pushes(40), square_rig(), "gp", name="learned", options=TrainingOptions(mean="zero"))
    found = held_out_windows(model).calibrated()
    mean, covariance, _ = found.held_out_moments()
    square = (found.training.outcomes - mean) ** 2 / np.diagonal(covariance, axis1=1, axis2=2)
    assert square.mean(axis=0) == pytest.approx(np.ones(3), rel=1e-6)


def test_a_refit_takes_as_many_rows_as_the_model_had_within_bounds() -> None:
    small = train_model(
        noisy_pushes(40), square_rig(), "gp", name="small", options=TrainingOptions(mean="zero")
    )  # 120 rows
    many = noisy_pushes(1200)
    assert len(spread_rows(small, many)) == 300
    large = replace(small, training=noisy_pushes(700))
    assert len(spread_rows(large, many)) == 500
    assert len(spread_rows(large, many).pushes) > 330


def sized(effect: Effect, sd: float = 1e-6) -> Sized:
    """The size of an effect with this standard deviation of its coefficients."""
    found = size_of(replace(effect, covariance=sd**2 * np.eye(len(effect.coefficients))), pushes(60, 0))
    assert found is not None
    return found


@pytest.mark.parametrize("size", [0.2, -0.2])
def test_interval_of_a_size_contains_errors_of_the_mechanics(size: float) -> None:
    """2.5 % remain where the data determine the coefficient exactly."""
    found = sized(planted("contact_friction", "session", CONSTANT, size))
    half = pytest.approx(1.96 * 0.025 * abs(size), rel=0.1)
    assert (found.value, found.high - size, size - found.low) == (pytest.approx(size), half, half)


def test_interval_of_a_size_is_widened_by_independent_errors() -> None:
    sized = Sized("lateness", 0.040, 0.038, 0.043, "s").with_errors_of_mechanics()
    assert (sized.low, sized.value, sized.high) == pytest.approx((0.040 - 0.0028, 0.040, 0.040 + 0.0036), abs=5e-5)
    assert Sized("bias", 0.0, -0.1, 0.2, "N").with_errors_of_mechanics() == Sized("bias", 0.0, -0.1, 0.2, "N")


@pytest.mark.parametrize("share", [0.02, 0.5, 0.98])
def test_size_of_a_step_does_not_depend_on_its_place(share: float) -> None:
    """Near the ends of its covariate, too, where drifts are not followed."""
    place = float(np.quantile(pushes(60, 0).covariates["elapsed_time"], share))
    step = DriverBasis("step", ("elapsed_time",), place=place)
    assert sized(planted("contact_friction", "elapsed_time", step, 0.1)).value == pytest.approx(0.1)


def test_length_of_a_vector_is_not_negative() -> None:
    assert sized(planted("tilted_surface", "push_heading", CONSTANT, 1e-4, 0.0), 1e-3).low >= 0.0


# --- a step that time explains as well --------------------------------------------------------------------------------


TIMED = pushes(20, 0)  # a push every 1000 / 19 s
STEP = DriverBasis("step", ("push_index",), place=7.5)


def term(basis: DriverBasis, *covariates: str) -> Any:
    values = basis.values(TIMED.covariates, len(TIMED))
    best = Candidate("contact_friction", basis.drivers[0], basis, np.zeros((len(TIMED), 3, 1)), values)
    return cast("Any", SimpleNamespace(best=best, naming=SimpleNamespace(covariates=covariates)))


def test_step_that_time_explains_as_well_is_the_same_step_of_time() -> None:
    found = by_the_clock(term(STEP, "push_index", "elapsed_time"), TIMED)
    assert (found.covariate, found.basis.name) == ("elapsed_time", "step")
    assert found.basis.place == pytest.approx(7.5 * 1000.0 / 19.0)
    assert np.array_equal(found.basis.values(TIMED.covariates, len(TIMED)), STEP.values(TIMED.covariates, len(TIMED)))


TWICE = replace(TIMED, covariates={**TIMED.covariates, "elapsed_time": TIMED.covariates["elapsed_time"] % 300.0})


@pytest.mark.parametrize(
    ("unchanged", "table"),
    [
        (term(STEP, "push_index", "slid_distance"), TIMED),  # time was rejected
        (term(DriverBasis("linear", ("push_index",), (9.5,), (5.0,)), "push_index", "elapsed_time"), TIMED),
        (term(DriverBasis("step", ("slider_x",), place=0.0), "slider_x", "elapsed_time"), TIMED),
        (term(STEP, "push_index", "elapsed_time"), TWICE),  # time does not order it
    ],
)
def test_every_other_effect_keeps_its_covariate(unchanged: Any, table: PushTable) -> None:
    assert by_the_clock(unchanged, table) is unchanged.best
