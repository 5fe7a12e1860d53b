# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Learnt models and the speed: per path length within the training's speeds, less certain beyond them."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from learnt_models import learnt, targets
from synthetic import RADIUS, square_rig

from push_predictor.models.features import DEVIATION
from push_predictor.models.mechanics.fitted import FittedMechanics, analytical_mechanics
from push_predictor.models.mechanics.forward import PushMechanics
from push_predictor.models.mechanisms import Push
from push_predictor.models.push_model import PushModel
from push_predictor.models.tabulated.tabulated_model import tabulate
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

RIG = square_rig()
MECHANICS = FittedMechanics(PushMechanics(RIG.outline, RADIUS), {"contact_friction": 0.25}, np.array([[1e-4]]))


def pushes(*speeds: float, n: int = 48, seed: int = 0, jitter: float = 0.0) -> PushTable:
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


def trained(table: PushTable, kind: str = "gp", **options: Any) -> PushModel:
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
    return trained(pushes(0.02), request.param.split()[0], about=about)


def test_twice_the_path_has_twice_the_mean_and_spread(slow: PushModel) -> None:
    (mean, covariance, process), twice = at(slow, 0.02), at(slow, 0.02, 0.4)
    if learnt(slow).mean is None:
        np.testing.assert_allclose(twice[0], 2.0 * mean, rtol=1e-9)
    np.testing.assert_allclose(twice[1], 4.0 * covariance, rtol=1e-9, atol=1e-20)
    np.testing.assert_allclose(twice[2], 4.0 * process, rtol=1e-9, atol=1e-20)


def test_without_mechanics_a_faster_push_of_the_same_path_has_the_same_mean() -> None:
    model = trained(pushes(0.02))
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
    model = trained(pushes(0.01, 0.03))
    assert learnt(model).scaling.speeds == pytest.approx((0.01, 0.03))
    assert not learnt(model).scaling.beyond(np.array([[speed, 0.1, 0.0] for speed in (0.01, 0.02, 0.03)])).any()
    np.testing.assert_allclose(learnt(model).scaling.beyond(np.array([[0.06, 0.1, 0.0]])), np.log(2.0))
    np.testing.assert_allclose(learnt(model).scaling.beyond(np.array([[0.0025, 0.1, 0.0]])), -np.log(4.0))


def test_what_changes_with_the_speed_is_learnt_and_kept_beyond() -> None:
    """Faster pushes that slide further, by half at 40 mm/s: per path length that is one function of the speed."""
    table = pushes(0.01, 0.04, n=90)
    further = np.where(table.inputs[:, :1] > 0.02, 1.5, 1.0)
    model = trained(replace(table, outcomes=table.outcomes * further))
    means = [at(model, speed)[0][:, 0] / speed for speed in (0.01, 0.04, 0.08)]
    assert np.median(means[1] / means[0]) == pytest.approx(1.5, abs=0.15)
    np.testing.assert_allclose(means[2], means[1], rtol=1e-9)


def test_noise_of_the_recorded_speed_is_no_input() -> None:
    jittery = learnt(trained(pushes(0.02, jitter=0.05)))
    assert 0 not in jittery.scaling.columns and jittery.scaling.speeds == pytest.approx((0.02, 0.02), rel=0.05)
    assert 0 in learnt(trained(pushes(0.02, 0.03, jitter=0.05))).scaling.columns


@pytest.mark.parametrize("about", (None, MECHANICS))
@pytest.mark.parametrize("speed", (0.02, 0.08))
def test_density_without_tails_is_that_of_the_moments(about: FittedMechanics | None, speed: float) -> None:
    table = pushes(speed, seed=2)
    predictor = learnt(trained(pushes(0.02), about=about, tails=False))
    mean, covariance, _ = predictor.moments(Push(table.inputs, table.duration, {}))
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    expected = -0.5 * (np.log(2.0 * np.pi * variance) + (table.outcomes - mean) ** 2 / variance)
    push = Push(table.inputs, table.duration, {})
    found = predictor._log_density(predictor.latent(table.inputs), push, table.outcomes)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_outcomes_are_learnt_as_they_are_where_asked() -> None:
    model = trained(pushes(0.02, 0.04), per_path=False)
    np.testing.assert_allclose(targets(learnt(model)), model.training.outcomes, rtol=1e-9, atol=1e-15)
    for first, second in zip(at(model, 0.02), at(model, 0.02, 0.4), strict=True):
        np.testing.assert_array_equal(first, second)


def test_a_table_predicts_the_same_at_all_speeds(slow: PushModel) -> None:
    several = trained(pushes(0.02, 0.03, n=90), slow.kind)
    for model in (slow, several):
        tabulated = tabulate(model)
        assert tabulated.tabulated, tabulated.how
        for speed, n in product((0.005, 0.02, 0.025, 0.03, 0.06, 0.15), (1, 6)):
            inputs = np.column_stack([np.full(n, speed), np.linspace(0.02, 0.9, n), np.linspace(-0.8, 0.8, n)])
            assert not tabulated.exact_count(inputs)
            found, expected = (m.predict_rows(inputs, np.full(n, 0.2)) for m in (tabulated, model))
            assert np.max(np.abs(found.mean - expected.mean) / expected.std) < 2e-3
            np.testing.assert_allclose(found.std, expected.std, rtol=5e-3)
            np.testing.assert_array_equal(found.in_domain, expected.in_domain)
