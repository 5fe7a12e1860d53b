# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Prior models: honest before the first push, sharper after a few, and usable without training rows everywhere."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import square_rig

from push_predictor import api
from push_predictor.cli import main
from push_predictor.errors import RequestError, RigError, TrainingError
from push_predictor.evaluation.alarm.scores import calibrate
from push_predictor.evaluation.validation import compare, metrics_json
from push_predictor.models.mechanics.fitted import FittedMechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanics.parameters import BY_NAME
from push_predictor.models.mechanics.pressure import supported_at
from push_predictor.models.mechanics.prior import (
    DRAWS,
    ProcessNoise,
    normal_draws,
    prior_draws,
    prior_spreads,
    table_of,
)
from push_predictor.models.predictors import PriorPredictor
from push_predictor.models.predictors.prior_predictor import FASTEST, STEEPEST
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push, Pushes
from push_predictor.models.train import retrain_model, train_model
from push_predictor.recordings.table import PushTable, empty_table
from push_predictor.residuals.evidence.loading import LoadedData
from push_predictor.residuals.trace import trace
from push_predictor.types import Array

pytestmark = pytest.mark.slow

CORNERS = np.array([[0.04, 0.04, 0.25], [-0.04, 0.04, 0.25], [-0.04, -0.04, 0.25], [0.04, -0.04, 0.25]])
RIG = replace(square_rig(), support_points=CORNERS)
TRUTH = {"contact_friction": 0.15, "centre_x": 0.004, "tracker_rotation": 0.04}


@pytest.fixture(scope="module")
def untrained() -> PushModel:
    return train_model(empty_table(), RIG, "prior", name="before")


def predictor_of(model: PushModel) -> PriorPredictor:
    assert isinstance(model.predictor, PriorPredictor)
    return model.predictor


def some_inputs(count: int, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(0.01, 0.05, count), rng.random(count), rng.uniform(-1.0, 1.0, count)])


def pushed(count: int, seed: int, noise: float = 0.03, windows: int = 2) -> PushTable:
    """Windows of a slider with the parameters TRUTH, with a noise that is a share of the travel."""
    inputs, duration = some_inputs(count, seed), np.full(count, 0.2)
    mechanics = PushMechanics(RIG.outline, RIG.pusher_radius, supported_at(CORNERS))
    unit = (inputs[:, 0] * duration)[:, None] * [1.0, 1.0, 25.0]
    outcomes = mechanics.displacement(TRUTH, inputs, duration)
    outcomes = outcomes + noise * unit * np.random.default_rng(seed + 1).standard_normal((count, 3))
    return PushTable(inputs, duration, outcomes, np.array([f"{seed}-{k // windows}" for k in range(count)]))


def trained(rows: PushTable) -> PushModel:
    return train_model(rows, RIG, "prior", name="after")


@pytest.fixture(scope="module")
def after_ten() -> PushModel:
    return trained(pushed(20, 3))


def displacements(
    mechanics: PushMechanics, names: tuple[str, ...], draws: Array, inputs: Array, duration: Array
) -> Array:
    return mechanics.displaced(table_of(names, draws)[None], Push(inputs, duration, {}))


# --- width -------------------------------------------------------------------------------------------------


def test_intervals_cover_outcomes_of_sliders_drawn_from_the_priors(untrained: PushModel) -> None:
    predictor, rng = predictor_of(untrained), np.random.default_rng(5)
    names = tuple(predictor.fitted.values)
    table = [BY_NAME[name] for name in names]
    sliders = rng.normal([p.textbook for p in table], prior_spreads(names), (400, len(names)))
    sliders = sliders[np.all((sliders > [p.low for p in table]) & (sliders < [p.high for p in table]), axis=1)]
    inputs, duration = some_inputs(15, 0), np.full(15, 0.2)
    found = displacements(predictor.fitted.mechanics, names, sliders, inputs, duration)
    prediction = untrained.predict_rows(inputs, duration)
    roots = np.linalg.cholesky(prediction.process_covariance)
    outcomes = found + np.einsum("nab,nkb->nka", roots, rng.standard_normal(found.shape))
    within = np.abs(outcomes - prediction.mean[:, None]) <= 1.96 * prediction.std[:, None]
    assert np.all(np.abs(within.mean(axis=(0, 1)) - 0.95) < 0.02)
    away = (outcomes - prediction.mean[:, None]) @ np.linalg.inv(np.linalg.cholesky(prediction.covariance))[
        :, None
    ].swapaxes(-1, -2)[:, 0]
    correlation = np.corrcoef(away.reshape(-1, 3).T)
    assert np.all(np.abs(correlation - np.eye(3)) < 0.15)


def test_pushes_narrow_the_prediction_and_move_it_to_the_truth(untrained: PushModel, after_ten: PushModel) -> None:
    test = pushed(40, 11, noise=0.0)
    before, after = compare(untrained, test), compare(after_ten, test)
    assert np.all(np.sqrt(after.variance / before.variance).mean(axis=0) < 0.75)
    errors = [np.sum((c.mean - test.outcomes) ** 2, axis=0) for c in (before, after)]
    assert np.all(errors[1] < 0.35 * errors[0])
    assert np.all((np.abs(after.mean - test.outcomes) < 1.96 * np.sqrt(after.variance)).mean(axis=0) > 0.9)


def test_estimates_are_the_most_probable_given_priors_and_pushes(untrained: PushModel, after_ten: PushModel) -> None:
    predictor, rows = predictor_of(after_ten), pushed(20, 3)
    means = predictor_of(untrained).fitted.values
    precision = np.linalg.inv(after_ten.predict_rows(rows.inputs, rows.duration).process_covariance) / 1.5

    names = tuple(means)
    spread = prior_spreads(names)
    found = np.array([predictor.fitted.values[name] for name in names])
    steps = 0.4 * np.concatenate([np.zeros((1, len(names))), np.eye(len(names)), -np.eye(len(names))])
    tried = found + steps * spread
    moved = displacements(predictor.fitted.mechanics, names, tried, rows.inputs, rows.duration)
    away = rows.outcomes[:, None] - moved
    prior = np.sum(((tried - list(means.values())) / spread) ** 2, axis=1)
    misfit = np.einsum("nsk,nkl,nsl->s", away, precision, away) + prior
    assert np.all(misfit[1:] > misfit[0]), misfit


def test_windows_of_one_push_count_less_than_windows_of_many() -> None:
    many = pushed(12, 6, windows=1)
    one = replace(many, push_id=np.array(["p"] * 12))
    fitted = [predictor_of(trained(rows)).fitted for rows in (many, one)]
    friction = list(fitted[0].values).index("contact_friction")
    spread = [np.sqrt(each.covariance[friction, friction]) for each in fitted]
    assert spread[1] > 1.3 * spread[0]


def test_process_noise_is_what_variations_of_friction_and_pressure_do() -> None:
    shifts = np.array([[1e-3, 0.0, 0.0], [0.0, 2e-3, 0.02], [0.0, 0.0, 0.03]])
    varied = np.concatenate([shifts, -shifts])[None]
    covariance = ProcessNoise(np.array([1.0, 4.0, 1.0])).covariance(varied, np.array([0.004]), 0.03)
    along = 1e-6 + (0.05 * 0.004) ** 2 + 1e-8
    across = 4.0 * (4e-6 + (0.05 * 0.004) ** 2 + 1e-8)
    turn = 4e-4 + 9e-4 + (0.05 * 0.004 / 0.03) ** 2 + 1e-6
    expected = [[along, 0.0, 0.0], [0.0, across, 8e-5], [0.0, 8e-5, turn]]
    np.testing.assert_allclose(covariance[0], expected, rtol=1e-9, atol=1e-18)


def test_process_noise_varies_parameters_to_both_sides_within_their_ranges() -> None:
    names = ("contact_friction", "centre_x", "centre_y")
    rows = ProcessNoise.changed(names, np.array([0.05, 0.0, 0.01]))
    np.testing.assert_allclose(rows[:, 0], [0.15, 0.05, 0.05, 0.0, 0.05, 0.05])
    np.testing.assert_allclose(rows[:, 2], [0.01, 0.01, 0.014, 0.01, 0.01, 0.006])


@pytest.mark.parametrize(
    ("windows", "noise", "low", "high"), [(20, 0.005, 0.0, 0.5), (20, 0.3, 2.0, np.inf), (2, 0.005, 0.6, 1.5)]
)
def test_noise_is_estimated_where_there_are_pushes(windows: int, noise: float, low: float, high: float) -> None:
    factor = predictor_of(trained(pushed(windows, 8, noise))).noise.factor
    assert np.all(low < factor)
    assert np.all(factor < high)


def test_estimates_stay_within_the_plausible_ranges() -> None:
    mechanics = PushMechanics(RIG.outline, RIG.pusher_radius, supported_at(CORNERS))
    inputs, duration = some_inputs(90, 9), np.full(90, 0.2)
    none, some = (mechanics.displacement({"contact_friction": value}, inputs, duration) for value in (0.0, 0.2))
    beyond = none + 0.5 * (none - some)  # as if friction were negative
    predictor = predictor_of(trained(PushTable(inputs, duration, beyond, np.arange(90).astype(str))))
    assert predictor.fitted.values["contact_friction"] == 0.0
    for k, name in enumerate(predictor.fitted.values):
        assert BY_NAME[name].low <= predictor.draws[:, k].min()
        assert predictor.draws[:, k].max() <= BY_NAME[name].high


# --- structure ---------------------------------------------------------------------------------------------


def test_the_same_seed_gives_the_same_model(untrained: PushModel) -> None:
    again = train_model(empty_table(), RIG, "prior", name="again")
    np.testing.assert_array_equal(predictor_of(again).draws, predictor_of(untrained).draws)
    assert predictor_of(again).draws.shape == (DRAWS, len(predictor_of(again).fitted.values))


def test_draws_have_the_covariance_of_the_priors_along_all_that_pushes_show(untrained: PushModel) -> None:
    fitted = predictor_of(untrained).fitted
    names, values = tuple(fitted.values), np.array(list(fitted.values.values()))
    spread, inputs, duration = prior_spreads(names), some_inputs(30, 2), np.full(30, 0.2)
    steps = np.diag(0.1 * spread)
    found = displacements(fitted.mechanics, names, np.concatenate([values + steps, values - steps]), inputs, duration)
    slopes = (found[:, : len(names)] - found[:, len(names) :]) / 0.2
    deviates = (prior_draws(fitted, 3) - values) / spread
    drawn = np.einsum("npk,pq,nqk->nk", slopes, deviates.T @ deviates / DRAWS, slopes)
    np.testing.assert_allclose(drawn, np.einsum("npk,npk->nk", slopes, slopes), rtol=0.05)


def test_draws_of_a_posterior_have_its_mean_and_its_correlations(after_ten: PushModel) -> None:
    fitted = predictor_of(after_ten).fitted
    values = {name: (0.5 if name == "contact_friction" else value) for name, value in fitted.values.items()}
    inside = FittedMechanics(fitted.mechanics, values, fitted.covariance)
    away = normal_draws(inside, 0) - list(values.values())
    names, spread = list(values), np.sqrt(np.diagonal(fitted.covariance))
    np.testing.assert_allclose(away.mean(axis=0) / spread, 0.0, atol=1e-9)
    one, other = names.index("contact_friction"), names.index("centre_x")
    drawn, true = away.T @ away / DRAWS, fitted.covariance
    for row, column in ((one, one), (other, other), (one, other)):
        scale = spread[row] * spread[column]
        np.testing.assert_allclose(drawn[row, column] / scale, true[row, column] / scale, atol=0.1)


def test_squares_of_deviates_vary_over_the_draws(untrained: PushModel) -> None:
    fitted = predictor_of(untrained).fitted
    deviates = (prior_draws(fitted, 0) - list(fitted.values.values())) / prior_spreads(tuple(fitted.values))
    assert np.var(np.square(deviates), axis=0).mean() > 0.5  # of a Gaussian 2, of a two-level design 0


def test_priors_use_what_the_rig_knows() -> None:
    on_points = train_model(empty_table(), replace(RIG, contact_friction=0.6), "prior", name="p")
    assert predictor_of(on_points).fitted.values["contact_friction"] == 0.6
    assert abs(predictor_of(on_points).draws[:, 0].mean() - 0.6) < 0.02
    assert "rim_exponent" not in predictor_of(on_points).fitted.values


def test_domain_is_the_whole_outline_at_quasi_static_speeds(untrained: PushModel, after_ten: PushModel) -> None:
    pushes = Pushes(
        [0.001, FASTEST, 1.01 * FASTEST, 0.02], [0.0, 0.99, 0.5, 0.3], [0.0, -STEEPEST, 0.0, 1.01 * STEEPEST]
    )
    assert (FASTEST, STEEPEST) == (0.15, 1.4)
    for model in (untrained, after_ten):
        limits = model.input_limits
        assert limits.velocity == (0.0, FASTEST) and limits.angle == (-STEEPEST, STEEPEST)
        assert model.in_domain(pushes.inputs).tolist() == [True, True, False, False]


# --- without training rows ---------------------------------------------------------------------------------


def test_untrained_model_is_scored_against_a_slider_at_rest(untrained: PushModel) -> None:
    test = pushed(30, 12)
    found = metrics_json(compare(untrained, test))
    rest = np.sum((test.outcomes - compare(untrained, test).mean) ** 2, axis=0) / np.sum(test.outcomes**2, axis=0)
    assert found["nmse"]["total"] == pytest.approx(rest.sum())
    assert found["n_train"] == 0


def test_alarm_and_trace_ask_for_training_pushes(untrained: PushModel) -> None:
    with pytest.raises(RequestError, match="training pushes of the model: 0"):
        calibrate(untrained)
    with pytest.raises(RequestError, match="one that was trained on pushes"):
        trace(untrained, LoadedData(pushed(20, 1), None, RIG))


def test_retraining_starts_from_the_priors(after_ten: PushModel) -> None:
    again = retrain_model(after_ten, pushed(20, 3))
    np.testing.assert_allclose(predictor_of(again).draws, predictor_of(after_ten).draws)
    assert again.kind == "prior" and again.predictor.absorbs


# --- interfaces --------------------------------------------------------------------------------------------


def test_python_interface_trains_without_data() -> None:
    model = api.train(kind="prior", rig=RIG, watch=lambda stage, done: None)
    assert (model.name, model.provenance.pushes) == ("prior", 0)
    with pytest.raises(RigError, match="neither data nor a rig"):
        api.train(kind="prior", watch=lambda stage, done: None)
    with pytest.raises(RequestError, match="at least one recording"):
        api.train(kind="gp", rig=RIG, watch=lambda stage, done: None)


def test_other_kinds_still_need_rows() -> None:
    with pytest.raises(TrainingError, match="too few"):
        train_model(empty_table(), RIG, "analytical", name="a")


@pytest.mark.long
def test_command_line_trains_and_predicts_before_the_first_push(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig, out = tmp_path / "rig.yaml", tmp_path / "before.pushmodel"
    rig.write_text("\n".join(f"{key}: {value}" for key, value in RIG.to_record().items()))
    assert main(["train", "--kind", "prior", "--rig", str(rig), "--out", str(out)]) == 0
    assert "from outline and priors alone" in capsys.readouterr().out
    assert main(["predict", str(out), "--velocity", "0.02", "--contact", "0.1", "--angle", "0.3"]) == 0
    assert "for which the priors are meant" in capsys.readouterr().out
    assert main(["info", str(out)]) == 0
    assert "velocity_range    none\n" in capsys.readouterr().out
