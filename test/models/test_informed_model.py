# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Learnt models about fitted mechanics and the speed: training, choice of the mean, other speeds, tables."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from learnt_models import learnt, targets
from synthetic import RADIUS, square_rig

from push_predictor.models import train, train_learnt
from push_predictor.models.features import DEVIATION
from push_predictor.models.gaussian_process import vhgp
from push_predictor.models.gaussian_process.bound import VhgpParameters
from push_predictor.models.gaussian_process.gp import GpParameters, fit_gp
from push_predictor.models.gaussian_process.prediction import exact_log_density
from push_predictor.models.gaussian_process.regression import ConstantNoise, best_held_out, fit_constant, held_out_score
from push_predictor.models.mechanics.fitted import FittedMechanics, analytical_mechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanisms import Push
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, retrain_model, train_model
from push_predictor.models.train_learnt import fitted_mean, zero_is_better
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

pytestmark = pytest.mark.slow

RIG = square_rig()
TRUE = {"contact_friction": 0.15, "rim_exponent": 1.0, "friction_difference": 0.05}
NOISE = np.array([2e-4, 2e-4, 5e-3])  # m, m, rad on a path of 4 mm


def pushes(n: int, seed: int, speeds: tuple[float, float] = (0.02, 0.02)) -> PushTable:
    """Windows by mechanics unlike the textbook's, noise in proportion to the path, two windows per push."""
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([rng.uniform(*speeds, n), rng.random(n), rng.uniform(-1.0, 1.0, n)])
    duration = np.full(n, 0.2)
    outcomes = PushMechanics(RIG.outline, RADIUS).displacement(TRUE, inputs, duration)
    outcomes += rng.standard_normal((n, 3)) * NOISE * (inputs[:, :1] * 0.2 / 0.004)
    return PushTable(inputs, duration, outcomes, np.array([f"{seed}-{k // 2}" for k in range(n)]))


def trained(table: PushTable, kind: str = "vhgp", **options: object) -> PushModel:
    return train_model(table, RIG, kind, name="m", options=TrainingOptions(**{"mean": "mechanics", **options}))


def exact_nlpd(model: PushModel, table: PushTable) -> float:
    density = model.exact_log_density(table)
    assert density is not None
    return -float(density.sum(axis=1).mean())


@pytest.fixture(scope="module")
def informed() -> PushModel:
    """A VHGP of 24 windows at 20 mm/s, about mechanics."""
    return trained(pushes(24, 0))


@pytest.fixture(scope="module")
def with_function() -> PushModel:
    """A GP of 40 windows, about mechanics that lack what the outcomes have: a shift that grows with the angle."""
    table = pushes(40, 1)
    outcomes = table.outcomes + 6e-4 * np.cos(3.0 * table.inputs[:, 2:])
    mechanics = FittedMechanics(PushMechanics(RIG.outline, RADIUS), TRUE, 1e-6 * np.eye(3))
    options = TrainingOptions(about=mechanics)
    return train_model(replace(table, outcomes=outcomes), RIG, "gp", name="m", options=options)


def test_few_pushes_teach_more_with_mechanics_than_without(informed: PushModel) -> None:
    later, plain = pushes(200, 2), trained(informed.training, mean="zero")
    assert exact_nlpd(informed, later) < exact_nlpd(plain, later) - 1.0


def test_without_a_function_to_learn_the_residual_is_constant_noise(informed: PushModel) -> None:
    assert sum(isinstance(r, ConstantNoise) for r in learnt(informed).regressions) >= 2


def test_a_residual_that_is_a_function_is_learnt(with_function: PushModel) -> None:
    assert not isinstance(learnt(with_function).regressions[0], ConstantNoise)
    assert replace(learnt(with_function), tails=None).gaussian


def test_a_tie_goes_to_mechanics_and_so_does_what_pushes_cannot_decide() -> None:
    zero, rng = np.zeros(40), np.random.default_rng(0)
    assert not zero_is_better(zero, zero)
    assert not zero_is_better(np.array([5.0]), np.array([0.0]))
    noise = rng.standard_normal(40)
    noise -= noise.mean()
    error = noise.std(ddof=1) / np.sqrt(40)
    assert not zero_is_better(noise + 0.9 * error, zero)
    assert zero_is_better(noise + 1.1 * error, zero)
    assert not zero_is_better(zero, noise + 1.1 * error)


def test_auto_is_decided_by_held_out_pushes_in_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same pushes under both means, one number a push; the answer is followed, with few rows and with many."""
    seen: list[tuple[np.ndarray, np.ndarray]] = []

    def answer(zero: np.ndarray, mechanics: np.ndarray) -> bool:
        seen.append((zero, mechanics))
        return better

    monkeypatch.setattr(train_learnt, "zero_is_better", answer)
    table = pushes(40, 3)
    for most, better in ((500, True), (20, False)):
        monkeypatch.setattr(train, "MOST_MEAN_ROWS", most)
        predictor = learnt(trained(table, "gp", mean="auto"))
        assert (predictor.mean is None) == better
        assert len(predictor.regressions[0].outputs) == 40
    assert [zero.shape for zero, _ in seen] == [mechanics.shape for _, mechanics in seen]
    assert [len(zero) for zero, _ in seen] == [20, len(set(drawn(table, 20).push_id))]
    # The densities are in the same units: with mechanics these pushes are more likely, by nats, not by orders.
    assert 0.0 < float(np.mean(seen[0][1] - seen[0][0])) < 20.0


def drawn(table: PushTable, count: int) -> PushTable:
    return table.take(train.training_rows(replace(table), None, 0, count))


def test_auto_takes_mechanics_where_they_help_and_zero_where_they_do_not() -> None:
    table = pushes(24, 3)
    assert learnt(trained(table, "gp", mean="auto")).mean is not None
    senseless = replace(table, outcomes=table.outcomes * [-1.0, 1.0, -1.0])
    assert learnt(trained(senseless, "gp", mean="auto")).mean is None


def test_predicts_pushes_of_other_speeds_as_well_as_a_model_trained_there(informed: PushModel) -> None:
    for speed in (0.01, 0.15):
        later, there = pushes(100, 4, (speed, speed)), pushes(48, 5, (speed, speed))
        assert exact_nlpd(informed, later) < exact_nlpd(trained(there, mean="zero"), later)
        assert not informed.predict_rows(later.inputs, later.duration).in_domain.any()


def test_it_needs_no_covariate_that_requests_lack() -> None:
    table = pushes(12, 13)
    headed = replace(table, covariates={"push_heading": np.linspace(-3.0, 3.0, 12)})
    assert fitted_mean(headed, RIG).mean.needs == ()


def test_retrained_it_keeps_its_mean_and_learns_the_residual_again(informed: PushModel) -> None:
    table = pushes(30, 10)
    table = replace(table, outcomes=table.outcomes + [1e-3, 0.0, 0.0])
    again, mean = learnt(retrain_model(informed, table)), learnt(informed).mean
    assert again.mean is mean and mean is not None
    path = table.inputs[:, :1] * 0.2
    residual = (table.outcomes - mean.displacement(table.inputs, table.duration)) * path.mean() / path
    np.testing.assert_allclose(targets(again), residual, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("per_path", (True, False))
def test_retrained_without_mechanics_it_learns_what_it_did(per_path: bool) -> None:
    table = pushes(30, 10, (0.02, 0.05))
    plain = trained(table, "gp", mean="zero", per_path=per_path)
    again = learnt(retrain_model(plain, table))
    assert again.mean is None
    np.testing.assert_allclose(targets(again), targets(learnt(plain)), rtol=1e-12)
    assert np.allclose(targets(again), table.outcomes, rtol=1e-9, atol=0.0) == (not per_path)


def test_a_vhgp_is_retrained_from_its_own_hyperparameters_where_it_is_near(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else from those of a GP that is fitted first, which takes half of the time."""
    plain = trained(pushes(40, 10, (0.02, 0.05)), "vhgp", mean="zero")
    begun: list[GpParameters] = []
    monkeypatch.setattr(vhgp, "fit_gp", None)
    search = vhgp.maximise_bound
    monkeypatch.setattr(vhgp, "maximise_bound", lambda *given: begun.append(given[2]) or search(*given))
    with pytest.raises(TypeError):  # without a GP it does not know where to begin
        retrain_model(plain, pushes(40, 11, (0.02, 0.05)))
    retrain_model(plain, pushes(40, 11, (0.02, 0.05)), nearby=True)
    assert len(begun) == 3
    for start, regression in zip(begun, learnt(plain).regressions, strict=True):
        found = regression.parameters
        assert isinstance(found, VhgpParameters) and np.array_equal(start.log_lengthscales, found.log_lengthscales)
        assert start.log_signal_sd == found.log_signal_sd
        noise = np.exp(found.noise_mean + 0.5 * (found.noise.variance + found.nugget))  # the mean of a log-normal
        assert start.noise_variance == pytest.approx(noise)


def test_constant_noise_follows_the_tails_of_the_residuals() -> None:
    rng = np.random.default_rng(0)
    outputs = rng.standard_t(3, 400)
    inputs = rng.standard_normal((400, 2))
    heavy, light = (fit_constant(inputs, outputs, heavy_tails=tails) for tails in (True, False))
    later = rng.standard_t(3, 4000)
    score = [exact_log_density(r.predict(np.zeros((4000, 2))), later).mean() for r in (heavy, light)]
    assert score[0] > score[1] + 0.05
    assert light.gaussian
    assert not heavy.gaussian
    assert light.noise_variance == pytest.approx(np.mean(outputs**2))


def test_a_regression_must_be_worth_its_hyperparameters() -> None:
    rng = np.random.default_rng(1)
    inputs, noise = rng.standard_normal((40, 2)), rng.standard_normal(40)
    block = np.arange(40)
    gp = fit_gp(inputs, noise)
    alone = fit_constant(inputs, noise, heavy_tails=False)
    assert best_held_out([alone, gp], block) is alone
    density = exact_log_density(alone.predict(inputs), noise).sum()
    assert held_out_score(alone, block) == pytest.approx(density - 1.0)
    wave = np.sin(3.0 * inputs[:, 0]) + 0.1 * noise
    assert best_held_out([fit_constant(inputs, wave, heavy_tails=False), found := fit_gp(inputs, wave)], block) is found


# --- the speed: per path length within the training's speeds, less certain beyond them ---


MECHANICS = FittedMechanics(PushMechanics(RIG.outline, RADIUS), {"contact_friction": 0.25}, np.array([[1e-4]]))


def pushes_at(*speeds: float, n: int = 48, seed: int = 0, jitter: float = 0.0) -> PushTable:
    """Windows at these speeds in turn, three a push, by the textbook's mechanics, with noise per path length.

    jitter: relative standard deviation of the recorded speed.
    """
    rng = np.random.default_rng(seed)
    speed = np.array([speeds[k // 3 % len(speeds)] for k in range(n)])
    inputs = np.column_stack([speed, rng.random(n), rng.uniform(-1.0, 1.0, n)])
    outcomes = analytical_mechanics(RIG.outline, RADIUS).displacement(inputs, np.full(n, 0.2))
    outcomes += rng.standard_normal((n, 3)) * [0.05, 0.05, 1.0] * (speed * 0.2)[:, None]
    inputs[:, 0] *= np.exp(jitter * rng.standard_normal(n))
    return PushTable(inputs, np.full(n, 0.2), outcomes, np.array([f"{seed}-{k // 3}" for k in range(n)]))


def trained_at(table: PushTable, kind: str = "gp", **options: Any) -> PushModel:
    return train_model(table, RIG, kind, name="m", options=TrainingOptions(**{"mean": "zero", **options}))


def at(model: PushModel, speed: float, duration: float = 0.2, n: int = 6) -> tuple[Array, Array, Array]:
    """Mean (n, 3), covariance and process covariance (n, 3, 3) of the same pushes at a speed."""
    inputs = np.column_stack([np.full(n, speed), np.linspace(0.02, 0.9, n), np.linspace(-0.8, 0.8, n)])
    found = model.predict_rows(inputs, np.full(n, duration))
    return found.mean, found.covariance, found.process_covariance


@pytest.fixture(scope="module", params=("gp", "vhgp", "gp about mechanics"))
def slow(request: pytest.FixtureRequest) -> PushModel:
    """Trained at 20 mm/s."""
    about = MECHANICS if "about" in request.param else None
    return trained_at(pushes_at(0.02), request.param.split()[0], about=about)


def test_twice_the_path_has_twice_the_mean_and_spread(slow: PushModel) -> None:
    (mean, covariance, process), twice = at(slow, 0.02), at(slow, 0.02, 0.4)
    if learnt(slow).mean is None:
        np.testing.assert_allclose(twice[0], 2.0 * mean, rtol=1e-9)
    np.testing.assert_allclose(twice[1], 4.0 * covariance, rtol=1e-9, atol=1e-20)
    np.testing.assert_allclose(twice[2], 4.0 * process, rtol=1e-9, atol=1e-20)


def test_without_mechanics_a_faster_push_of_the_same_path_has_the_same_mean() -> None:
    model = trained_at(pushes_at(0.02))
    np.testing.assert_allclose(at(model, 0.08, 0.05)[0], at(model, 0.02, 0.2)[0], rtol=1e-9)


@pytest.mark.parametrize("ratio", (0.25, 0.5, 2.0, 4.0, 8.0))
def test_spread_grows_with_the_distance_of_the_speed_and_noise_of_slow_pushes_too(
    slow: PushModel, ratio: float
) -> None:
    """In units of what was learnt, per path length: (DEVIATION log ratio)^2 more, and more noise in slower pushes."""
    (_, near, noise), (_, far, far_noise) = at(slow, 0.02), at(slow, 0.02 * ratio)
    growth = max(1.0 / ratio, 1.0)
    np.testing.assert_allclose(far_noise / ratio**2, noise * growth, rtol=1e-9, atol=1e-20)
    more = far / ratio**2 - (near - noise + noise * growth)
    expected = np.diag((DEVIATION * np.log(ratio) * learnt(slow).reported_sd) ** 2)
    np.testing.assert_allclose(more, np.broadcast_to(expected, more.shape), rtol=1e-6, atol=1e-6 * expected[0, 0])


def test_between_training_speeds_nothing_is_added() -> None:
    model = trained_at(pushes_at(0.01, 0.03))
    assert learnt(model).scaling.speeds == pytest.approx((0.01, 0.03))
    assert not learnt(model).scaling.beyond(np.array([[speed, 0.1, 0.0] for speed in (0.01, 0.02, 0.03)])).any()
    np.testing.assert_allclose(learnt(model).scaling.beyond(np.array([[0.06, 0.1, 0.0]])), np.log(2.0))
    np.testing.assert_allclose(learnt(model).scaling.beyond(np.array([[0.0025, 0.1, 0.0]])), -np.log(4.0))


def test_what_changes_with_the_speed_is_learnt_and_kept_beyond() -> None:
    """Faster pushes that slide further, by half at 40 mm/s: per path length that is one function of the speed."""
    table = pushes_at(0.01, 0.04, n=90)
    further = np.where(table.inputs[:, :1] > 0.02, 1.5, 1.0)
    model = trained_at(replace(table, outcomes=table.outcomes * further))
    means = [at(model, speed)[0][:, 0] / speed for speed in (0.01, 0.04, 0.08)]
    assert np.median(means[1] / means[0]) == pytest.approx(1.5, abs=0.15)
    np.testing.assert_allclose(means[2], means[1], rtol=1e-9)


def test_noise_of_the_recorded_speed_is_no_input() -> None:
    jittery = learnt(trained_at(pushes_at(0.02, jitter=0.05)))
    assert 0 not in jittery.scaling.columns and jittery.scaling.speeds == pytest.approx((0.02, 0.02), rel=0.05)
    assert 0 in learnt(trained_at(pushes_at(0.02, 0.03, jitter=0.05))).scaling.columns


@pytest.mark.parametrize("about", (None, MECHANICS))
@pytest.mark.parametrize("speed", (0.02, 0.08))
def test_density_without_tails_is_that_of_the_moments(about: FittedMechanics | None, speed: float) -> None:
    table = pushes_at(speed, seed=2)
    predictor = learnt(trained_at(pushes_at(0.02), about=about, tails=False))
    mean, covariance, _ = predictor.moments(Push(table.inputs, table.duration, {}))
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    expected = -0.5 * (np.log(2.0 * np.pi * variance) + (table.outcomes - mean) ** 2 / variance)
    push = Push(table.inputs, table.duration, {})
    assert predictor.tails is None
    found = predictor._log_density(predictor.latent(table.inputs), push, table.outcomes)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_outcomes_are_learnt_as_they_are_where_asked() -> None:
    model = trained_at(pushes_at(0.02, 0.04), per_path=False)
    np.testing.assert_allclose(targets(learnt(model)), model.training.outcomes, rtol=1e-9, atol=1e-15)
    for first, second in zip(at(model, 0.02), at(model, 0.02, 0.4), strict=True):
        np.testing.assert_array_equal(first, second)
