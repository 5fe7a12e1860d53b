# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The alarm that may be read after every push: how often it is false, how soon it is true."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from coarse import coarse_fits
from scipy.stats import binom
from synthetic import square_rig

from push_predictor.errors import RequestError
from push_predictor.evaluation.alarm.evidence import Alarm, ScoreKind, alarm_json, with_alarm
from push_predictor.evaluation.alarm.scores import (
    FOLDS,
    AlarmMonitor,
    _scores_by_push,
    alarm_state,
    calibrate,
    held_out_moments,
)
from push_predictor.evaluation.splits import push_folds
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.mechanics.fitted import analytical_mechanics
from push_predictor.models.mechanisms import LIBRARY, Push
from push_predictor.models.predictors import ExtendedPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.train import TrainingOptions, retrain_model, train_model
from push_predictor.recordings.table import PushTable
from push_predictor.types import Array

SIZE, SHIFT = ScoreKind("size", 0.5, False), ScoreKind("shift", 0.5, True)
KINDS = (SIZE, SHIFT)


def scores(n: int, seed: int, shift: float = 0.0) -> Array:
    """Two scores of n pushes that depend on each other; heavy tails."""
    z = np.random.default_rng(seed).standard_t(4.0, n) + shift
    return np.column_stack([z**2, z])


def fired_after(alarm: Alarm, pushes: Array) -> int | None:
    for k, row in enumerate(pushes):
        if alarm.add(f"push-{k}", row):
            return k + 1
    return None


# --- the bets --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "calibration"), [(0.1, 5), pytest.param(0.1, 60, marks=pytest.mark.long)])
def test_false_alarm_probability_is_at_most_the_rate(rate: float, calibration: int):
    """With few calibration pushes just as with many; the union over two scores that depend leaves room."""
    runs, pushes = 400, 40
    fired = sum(
        fired_after(Alarm(KINDS, rows[:calibration], rate, seed), rows[calibration:]) is not None
        for seed in range(runs)
        for rows in [scores(calibration + pushes, seed)]
    )
    assert 0 < fired <= binom.ppf(0.999, runs, rate)


def test_larger_changes_are_detected_sooner():
    delays = []
    for shift in (1.0, 2.0, 4.0):
        found = []
        for seed in range(10):
            pushes = np.concatenate([scores(30, 1000 + seed), scores(150, 2000 + seed, shift)])
            found.append(fired_after(Alarm(KINDS, scores(150, seed), 0.01), pushes))
        assert all(after is not None and after > 30 for after in found), (shift, found)
        delays.append(np.median([after - 30 for after in found if after is not None]))
    assert delays[0] > delays[1] > delays[2] and delays[0] < 80 and delays[2] <= 10, delays


def test_smaller_residuals_give_no_alarm():
    alarm = Alarm((ScoreKind("size", 1.0, False),), scores(150, 0)[:, :1], 0.01)
    assert fired_after(alarm, scores(200, 1)[:, :1] * 0.05) is None


def test_equal_scores_are_ranked_at_random_and_give_no_evidence():
    fired = [fired_after(Alarm(KINDS, np.zeros((30, 2)), 0.05, seed), np.zeros((60, 2))) for seed in range(30)]
    assert sum(after is not None for after in fired) <= binom.ppf(0.999, 30, 0.05)
    alike = [Alarm(KINDS, np.zeros((30, 2)), 0.05, seed) for seed in (7, 7, 8)]
    for alarm in alike:
        alarm.add("a", np.zeros(2))
    one, same, other = (alarm.state.log10_evidence for alarm in alike)
    assert one == same != other


def test_alarm_fires_once_and_again_only_after_a_reset():
    alarm, pushes = Alarm(KINDS, scores(100, 0), 0.01), scores(60, 1, 4.0)
    first = fired_after(alarm, pushes)
    state = alarm.state
    assert first is not None and (state.fired_at, state.fired_after) == (f"push-{first - 1}", first)
    assert state.fired_evidence is not None and state.fired_evidence >= state.threshold == 2.0
    assert fired_after(alarm, pushes) is None and alarm.state.fired_at == state.fired_at
    alarm.reset()
    assert not alarm.state.fired and alarm.state.pushes == 0
    assert fired_after(alarm, pushes) == first


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_rejects_a_score_that_is_not_finite_by_name(wrong: float):
    with pytest.raises(RequestError, match=r"score shift: .* finite"):
        Alarm(KINDS, scores(10, 0), 0.01).add("push", np.array([1.0, wrong]))
    with pytest.raises(RequestError, match="score size"):
        Alarm(KINDS, np.array([[wrong, 0.0]]), 0.01)


@pytest.mark.parametrize("rate", [0.0, 1.0, -0.1, np.nan])
def test_rejects_a_rate_that_is_not_a_probability(rate: float):
    with pytest.raises(RequestError, match="false_alarm_rate"):
        Alarm(KINDS, scores(10, 0), rate)


def test_alarm_is_added_to_the_json_without_other_changes():
    alarm = Alarm(KINDS, scores(100, 0), 0.01)
    quiet = json.loads(with_alarm('{"model": "m"}', alarm_json(alarm.state)))
    assert quiet["model"] == "m" and quiet["alarm"]["fired"] is False and quiet["alarm"]["push_id"] is None
    after = fired_after(alarm, scores(60, 1, 4.0))
    alarm_field = alarm_json(alarm.state)
    assert (alarm_field["fired"], alarm_field["pushes"], alarm_field["push_id"]) == (
        True,
        after,
        f"push-{(after or 0) - 1}",
    )
    assert alarm_json(None, "too few pushes") == {"fired": False, "off": "too few pushes"}


calibrated = cache(calibrate)  # the same for every test of a model


# --- pushes and models -----------------------------------------------------------------------------------------------

NOISE = np.array([1e-4, 1e-4, 2e-3])


def made_up(pushes: int, seed: int, friction: float = 0.3, windows: int = 3) -> PushTable:
    """Pushes of a slider that is what the analytical model says, with noise that windows of one push share in part."""
    rng, rig, n = np.random.default_rng(seed), square_rig(), pushes * windows
    inputs = np.column_stack([np.full(n, 0.025), rng.random(n), rng.uniform(-1.1, 1.1, n)])
    duration = np.full(n, 0.2)
    push_id = np.array([f"{seed}-{k // windows:04d}" for k in range(n)])
    noise = 0.8 * rng.standard_normal((n, 3)) + np.repeat(0.6 * rng.standard_normal((pushes, 3)), windows, axis=0)
    physics = analytical_mechanics(rig.outline, rig.pusher_radius, contact_friction=friction)
    outcomes = physics.displacement(inputs, duration) + NOISE * noise
    return PushTable(inputs, duration, outcomes, push_id, {"slider_heading": rng.uniform(-3.0, 3.0, n)})


@pytest.fixture(scope="module", autouse=True)
def coarsely() -> Iterator[None]:
    with coarse_fits(8):
        yield


@pytest.fixture(autouse=True)
def a_library_of_three(monkeypatch: pytest.MonkeyPatch) -> None:
    """Computing responses takes most of the time."""
    few = [m for m in LIBRARY if m.name in ("contact_friction", "pressure_spread", "tilted_surface")]
    monkeypatch.setattr("push_predictor.evaluation.alarm.scores.LIBRARY", few)


@pytest.fixture(scope="module")
def models() -> dict[str, PushModel]:
    table = made_up(80, 0)
    return {
        kind: train_model(table, square_rig(), kind, name=kind, options=TrainingOptions(mean="zero"))
        for kind in ("analytical", "gp")
    }


def alarm_of(model: PushModel, table: PushTable):
    prediction = model.predict_rows(table.inputs, table.duration, table.covariates)
    return alarm_state(calibrated(model), table, prediction.mean, prediction.covariance)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["analytical", "gp"])
def test_alarm_fires_after_a_change_and_not_on_pushes_like_the_training(kind: str, models: dict[str, PushModel]):
    assert not alarm_of(models[kind], made_up(120, 1)).fired
    changed = made_up(120, 2, friction=0.6).take(np.arange(180))  # 60 pushes
    state = alarm_of(models[kind], changed)
    assert state.fired and state.fired_after is not None and state.fired_after < 60
    assert state.fired_by in ("contact_friction: change of the contact friction", "size of the residual")


def test_training_pushes_of_a_learnt_model_are_scored_by_refits_of_the_other_half(models: dict[str, PushModel]):
    """Hyperparameters that have seen a push make its residuals smaller than those of a new one."""
    model = models["gp"]
    rows, folds = model.training, push_folds(model.training, FOLDS)
    mean, covariance = held_out_moments(model)
    for fold in range(FOLDS):
        refitted, own = retrain_model(model, rows.take(np.flatnonzero(folds != fold))), folds == fold
        expected = refitted.predict_rows(rows.inputs[own], rows.duration[own])
        np.testing.assert_allclose(mean[own], expected.mean, rtol=1e-9)
        np.testing.assert_allclose(covariance[own], expected.covariance, rtol=1e-9)
    assert np.abs(mean - model.held_out_moments(folds).mean).max() > 1e-5


def test_effects_are_kept_while_the_base_is_refitted_without_them(models: dict[str, PushModel]):
    base, rows = models["gp"], models["gp"].training
    drift = DriverBasis("linear", ("slider_heading",), (0.0,), (3.0,))
    effect = Effect(None, "slider_heading", drift, np.full(18, 0.3), 1e-4 * np.eye(18), np.array([0.02, 0.02, 0.5]))
    predictor = ExtendedPredictor(base.predictor.base, (effect,), np.array([1.0, 1.2, 1.0]))
    shift = predictor.shift(Push.of(rows)).mean
    moved = replace(rows, outcomes=rows.outcomes + shift)
    mean, covariance = held_out_moments(replace(base, predictor=predictor, training=moved))
    of_base, without = held_out_moments(base)
    np.testing.assert_allclose(mean, of_base + shift, atol=1e-9)
    assert np.all(covariance[:, 1, 1] > 1.4 * without[:, 1, 1])


def test_hyperparameters_are_kept_where_half_the_rows_are_too_few_to_refit_them():
    model = train_model(made_up(12, 3, windows=1), square_rig(), "gp", name="few", options=TrainingOptions(mean="zero"))
    kept = model.held_out_moments(push_folds(model.training, FOLDS))
    assert np.array_equal(held_out_moments(model)[0], kept.mean)
    assert calibrate(model).scores.shape[0] == 12


def scores_of(model: PushModel, table: PushTable) -> Array:
    prediction = model.predict_rows(table.inputs, table.duration)
    found = _scores_by_push(calibrated(model), table, prediction.mean, prediction.covariance)
    return np.array([found[push] for push in table.pushes])


def test_score_is_as_wide_for_many_windows_as_for_few(models: dict[str, PushModel]):
    """Windows of a push share a part of their noise, so their sum grows faster than the root of their number."""
    model = models["analytical"]
    found = calibrated(model)
    assert found.window_correlation[1:4] == pytest.approx(0.36, abs=0.15)
    for windows in (1, 8):
        spread = scores_of(model, made_up(150, 8, windows=windows)).std(axis=0)[1:4]
        assert spread == pytest.approx(found.scores.std(axis=0)[1:4], rel=0.25), windows


def test_windows_of_different_pushes_are_not_correlated():
    model = train_model(made_up(60, 0, windows=1), square_rig(), "analytical", name="single windows")
    assert not calibrate(model).window_correlation.any()


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_every_score_but_the_size_counts_in_both_directions(sign: float, models: dict[str, PushModel]):
    model = models["analytical"]
    found, table = calibrated(model), made_up(60, 9)
    assert [kind.two_sided for kind in found.kinds] == [False] + [True] * (len(found.kinds) - 1)
    moved = scores_of(model, replace(table, outcomes=table.outcomes + sign * 2.0 * NOISE))
    for k in (1, 2, 3):
        alarm = Alarm((replace(found.kinds[k], weight=1.0),), found.scores[:, k : k + 1], 0.01)
        assert fired_after(alarm, moved[:, k : k + 1]) is not None, found.kinds[k].name


@pytest.mark.slow
def test_alarm_is_equal_for_pushes_one_by_one_and_all_at_once(models: dict[str, PushModel]):
    """A fast push among them, whose integration takes its steps from the longest."""
    model, table = models["analytical"], made_up(3, 5, friction=0.45)
    velocity = np.repeat([0.15, 0.05, 0.05], 3)
    table = replace(table, inputs=np.column_stack([velocity, table.inputs[:, 1:]]))
    prediction, calibration = model.predict_rows(table.inputs, table.duration), calibrated(model)
    monitor = AlarmMonitor(calibration)
    for push in table.pushes:
        rows = table.push_id == push
        monitor.add(table.take(rows), prediction.mean[rows], prediction.covariance[rows])
    whole = alarm_state(calibration, table, prediction.mean, prediction.covariance)
    assert monitor.state.log10_evidence == pytest.approx(whole.log10_evidence, abs=1e-9)
    assert monitor.state.fired_at == whole.fired_at


@pytest.mark.slow
def test_repeated_push_is_ignored(models: dict[str, PushModel]):
    model, table = models["analytical"], made_up(10, 6)
    monitor, prediction = AlarmMonitor(calibrated(model)), model.predict_rows(table.inputs, table.duration)
    for _ in range(2):
        monitor.add(table, prediction.mean, prediction.covariance)
    assert monitor.state.pushes == 10


@pytest.mark.slow
def test_push_without_a_covariate_is_skipped_and_named(models: dict[str, PushModel]):
    model, table = models["analytical"], made_up(10, 7)
    heading = table.covariates["slider_heading"].copy()
    heading[4] = np.nan
    monitor, prediction = AlarmMonitor(calibrated(model)), model.predict_rows(table.inputs, table.duration)
    monitor.add(replace(table, covariates={"slider_heading": heading}), prediction.mean, prediction.covariance)
    assert monitor.state.pushes == 9
    (reason,) = monitor.skipped
    assert "push 7-0001" in reason and "finite" in reason


def test_model_with_too_few_pushes_has_no_alarm():
    model = train_model(made_up(9, 0), square_rig(), "analytical", name="few")
    with pytest.raises(RequestError, match=r"training pushes of the model: 9 .* at least 10"):
        calibrate(model)
