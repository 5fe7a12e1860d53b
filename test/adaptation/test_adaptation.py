# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A model that follows the rig push by push: what it learns, how sure it is, and what it leaves alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drifting_models import extended, grain, pushes, slippery
from synthetic import square_pushes, square_rig

from push_predictor.adaptation import Adaptation
from push_predictor.adaptation.followed import follow
from push_predictor.adaptation.walk import CORRELATION, Noise, Observed, Walk
from push_predictor.errors import RequestError
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.mechanisms import mechanism_named
from push_predictor.models.predictors import ExtendedPredictor, PriorPredictor
from push_predictor.models.push_model import PushModel
from push_predictor.models.store.model_file import load_model
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.table import PushTable, concatenate, empty_table
from push_predictor.types import Array


def constant(mechanism: str, *values: float) -> Effect:
    zero = np.zeros((len(values), len(values)))
    return Effect(mechanism, "constant", DriverBasis("constant"), np.array(values), zero, np.ones(3))


@pytest.fixture(scope="module")
def deployed() -> PushModel:
    """Textbook mechanics with the noise of Monday's pushes."""
    return train_model(pushes(60, 0), square_rig(), "analytical", name="monday")


@pytest.fixture(scope="module")
def slick(deployed: PushModel) -> Adaptation:
    """After 40 pushes with half of the contact friction."""
    return adapted_to(deployed, pushes(40, 1, constant("contact_friction", -0.15)))


def each(table: PushTable) -> list[PushTable]:
    return [table.take(table.push_id == push) for push in table.pushes]


def adapted_to(model: PushModel, table: PushTable, *args: Any, **options: Any) -> Adaptation:
    adaptation = Adaptation(model, *args, **options)
    for push in each(table):
        adaptation.update(push)
    return adaptation


def nlpd(model: PushModel, table: PushTable) -> float:
    found = model.predict_rows(table.inputs, table.duration, table.covariates)
    away, variance = table.outcomes - found.mean, np.diagonal(found.covariance, axis1=1, axis2=2)
    return float(0.5 * np.mean(np.sum(away**2 / variance + np.log(variance), axis=1)))


def changes(adaptation: Adaptation) -> dict[str, float]:
    return {p.name: p.value - p.deployed for p in adaptation.parameters}


@pytest.mark.parametrize(
    ("mechanism", "values"),
    [("contact_friction", [-0.15]), ("centre_of_friction", [0.006, -0.004]), ("body_anisotropy", [0.3, 0.0])],
)
def test_ten_pushes_bring_half_of_what_knowing_the_change_brings_and_thirty_four_fifths(
    deployed: PushModel, mechanism: str, values: list[float]
) -> None:
    change = constant(mechanism, *values)
    later = pushes(100, 2, change)
    known = extended(deployed, change)
    gain = nlpd(deployed, later) - nlpd(known, later)
    for count, share in ((10, 0.5), (30, 0.8)):
        adapted = adapted_to(deployed, pushes(count, 1, change)).adapted
        assert nlpd(deployed, later) - nlpd(adapted, later) > share * gain > 0.0


def test_what_changed_is_in_its_interval_and_what_certainly_stayed_costs_no_time(
    deployed: PushModel, slick: Adaptation
) -> None:
    by_name = {parameter.name: parameter for parameter in slick.parameters}
    friction = by_name.pop("contact_friction")
    assert friction.low < 0.15 < friction.high and friction.high - friction.low < 0.15
    assert friction.deployed == 0.3 and friction.changed
    assert not any(parameter.changed for parameter in by_name.values())
    assert str(slick).startswith("contact friction 0.1") and "0.3 when trained, after 40 pushes" in str(slick)
    (effect,) = slick.adapted.predictor.effects
    assert effect.mechanism == "contact_friction"
    assert friction.high - friction.low == pytest.approx(2.0 * 1.96 * effect.covariance[0, 0] ** 0.5, rel=0.01)
    assert len(Adaptation(deployed).adapted.predictor.effects) == 5


def test_where_nothing_changed_predictions_stay_and_a_later_jump_is_followed(deployed: PushModel) -> None:
    adaptation, later = adapted_to(deployed, pushes(60, 1)), pushes(100, 2)
    assert nlpd(adaptation.adapted, later) < nlpd(deployed, later) + 0.02
    assert str(adaptation) == "no parameter has certainly changed, after 60 pushes"
    np.testing.assert_allclose(adaptation.noise, 1.0, atol=0.15)
    for push in each(pushes(12, 2, constant("contact_friction", -0.2))):
        adaptation.update(push)
    assert changes(adaptation)["contact_friction"] < -0.1


def test_before_the_first_push_the_mean_is_the_deployed_one_and_the_covariance_larger(deployed: PushModel) -> None:
    table = pushes(20, 1)
    before, after = (m.predict_rows(table.inputs, table.duration) for m in (deployed, Adaptation(deployed).adapted))
    np.testing.assert_allclose(after.mean, before.mean, atol=1e-9)
    assert np.all(np.linalg.eigvalsh(after.covariance - before.covariance) > -1e-12)


def test_noise_that_doubled_is_found(deployed: PushModel) -> None:
    table = pushes(80, 1)
    mean = deployed.predict_rows(table.inputs, table.duration).mean
    noisy = replace(table, outcomes=mean + 2.0 * (table.outcomes - mean))
    np.testing.assert_allclose(adapted_to(deployed, noisy).noise, 2.0, rtol=0.2)


def test_parameters_that_no_rig_has_are_an_alarm_and_not_followed(deployed: PushModel) -> None:
    impossible = constant("centre_of_friction", 0.045, 0.0)
    largest = mechanism_named("centre_of_friction").parameters[0].largest
    assert largest >= 0.045  # the effect is applied whole
    adaptation = adapted_to(deployed, pushes(40, 1, impossible), ("centre_of_friction",), 0.3)
    assert adaptation.out_of_range and "parameters that no rig has" in str(adaptation)
    assert abs(changes(adaptation)["centre_x"]) <= 0.03


def test_what_depends_on_the_heading_is_followed_only_where_its_parameters_are_in_the_set(deployed: PushModel) -> None:
    tilt = constant("tilted_surface", 0.1, 0.0)
    table, later = pushes(40, 1, tilt), pushes(60, 2, tilt)
    usual = adapted_to(deployed, table).adapted
    followed = adapted_to(deployed, table, ("tilted_surface", "contact_friction"))
    assert changes(followed)["slope_x"] == pytest.approx(0.1, abs=0.03)
    assert nlpd(followed.adapted, later) < nlpd(usual, later) - 0.1
    with pytest.raises(RequestError, match="slider_heading"):
        followed.update(replace(each(table)[0], covariates={}))


def test_effects_of_the_deployed_model_stay(deployed: PushModel) -> None:
    base = extended(deployed, slippery(-0.1), grain(0.3), scale=(1.5, 1.0, 1.0))
    table = pushes(40, 1, slippery(-0.1), grain(0.3), constant("contact_friction", -0.1))
    adaptation = adapted_to(base, table)
    assert adaptation.adapted.predictor.effects[:2] == base.predictor.effects
    assert changes(adaptation)["contact_friction"] == pytest.approx(-0.1, abs=0.06)
    later = pushes(60, 2, slippery(-0.1), grain(0.3), constant("contact_friction", -0.1))
    assert nlpd(adaptation.adapted, later) < nlpd(base, later)


def test_what_a_learnt_model_has_learnt_beside_its_mechanics_stays(tmp_path: Path) -> None:
    table, rig = square_pushes(60)
    learnt = train_model(table, rig, "gp", name="gp")
    adapted = adapted_to(learnt, square_pushes(4, seed=1)[0]).adapted
    assert adapted.predictor.base is learnt.predictor and adapted.name == "gp_adapted"
    adapted.save(tmp_path / "adapted.pushmodel")
    again = load_model(tmp_path / "adapted.pushmodel").predict_rows(table.inputs, table.duration)
    expected = adapted.predict_rows(table.inputs, table.duration)
    np.testing.assert_allclose(again.mean, expected.mean)
    np.testing.assert_allclose(again.covariance, expected.covariance)


def test_a_prior_model_follows_in_its_own_parameters() -> None:
    prior = train_model(empty_table(), square_rig(), "prior", name="prior")
    slick = constant("contact_friction", -0.15)
    adaptation, later = adapted_to(prior, pushes(15, 1, slick)), pushes(60, 2, slick)
    (friction,) = (p for p in adaptation.parameters if p.name == "contact_friction")
    assert friction.low < 0.15 < friction.high
    assert nlpd(adaptation.adapted, later) < nlpd(prior, later) - 0.2
    assert adaptation.adapted.predictor.effects == ()


def test_a_second_change_is_found_though_the_first_explained_much(deployed: PushModel) -> None:
    first, both = constant("contact_friction", -0.2), constant("centre_of_friction", 0.0, 0.008)
    adaptation = adapted_to(deployed, pushes(60, 1, first))
    for push in each(pushes(30, 2, first, both)):
        adaptation.update(push)
    assert changes(adaptation)["centre_y"] == pytest.approx(0.008, abs=0.003)


def test_while_it_is_open_whether_something_changed_the_interval_reaches_from_one_to_the_other(
    deployed: PushModel,
) -> None:
    adaptation, change = Adaptation(deployed), -0.06
    for push in each(pushes(40, 1, constant("contact_friction", change))):
        adaptation.update(push)
        friction = adaptation.parameters[0]
        if 0.3 < (friction.value - friction.deployed) / change < 0.7:
            assert friction.high - friction.low > 1.5 * abs(change)
            return
    raise AssertionError("it was never open")


def test_no_interval_leaves_the_plausible_range(deployed: PushModel) -> None:
    adaptation = Adaptation(deployed)
    for push in each(pushes(12, 1, constant("contact_friction", -0.29))):
        adaptation.update(push)
        assert all(p.low >= 0.0 for p in adaptation.parameters if p.name == "contact_friction")


def test_the_noise_is_a_factor_on_what_the_deployed_model_has(deployed: PushModel) -> None:
    base = extended(deployed, slippery(-0.1), scale=(1.5, 1.0, 1.0))
    adaptation = adapted_to(base, pushes(5, 1, slippery(-0.1)))
    found = adaptation.adapted.predictor
    assert isinstance(found, ExtendedPredictor)
    np.testing.assert_allclose(found.scale, [1.5, 1.0, 1.0] * adaptation.noise)
    prior = train_model(pushes(20, 1), square_rig(), "prior", name="prior")
    adaptation = adapted_to(prior, pushes(5, 2))
    before, after = prior.predictor, adaptation.adapted.predictor
    assert isinstance(before, PriorPredictor) and isinstance(after, PriorPredictor)
    np.testing.assert_allclose(after.noise.factor, before.noise.factor * adaptation.noise**2)


def test_the_outputs_of_a_learnt_model_are_taken_one_by_one() -> None:
    learnt = train_model(*square_pushes(60), "gp", name="gp")
    apart = replace(learnt, predictor=learnt.predictor.with_independent_outputs())
    table = square_pushes(4, seed=1)[0]
    assert changes(adapted_to(learnt, table)) == pytest.approx(changes(adapted_to(apart, table)), abs=1e-9)


def test_what_cannot_follow_is_refused_by_name(deployed: PushModel) -> None:
    learnt = train_model(*square_pushes(30), "gp", name="blind", options=TrainingOptions(mean="zero"))
    with pytest.raises(RequestError, match="model: 'blind' is not accepted, give a model about mechanics"):
        Adaptation(learnt)
    refused: tuple[tuple[dict[str, Any], str], ...] = (
        ({"mechanisms": ["glue"]}, "mechanisms: .*glue"),
        ({"mechanisms": []}, "mechanisms"),
        ({"mechanisms": ["contact_friction"] * 2}, "each once"),
        ({"speed": -0.1}, "speed: -0.1"),
        ({"speed": np.nan}, "speed: nan"),
    )
    for options, message in refused:
        with pytest.raises(RequestError, match=message):
            Adaptation(deployed, **options)
    adaptation = Adaptation(deployed)
    for table in (empty_table(), pushes(2, 1)):
        with pytest.raises(RequestError, match="those of one push"):
            adaptation.update(table)
    assert adaptation.pushes == 0


# --- the filter -------------------------------------------------------------------------------------------------


def walk(speeds: dict[float, float] | None = None) -> Walk:
    covariance, noise = np.diag([0.04, 0.01]), Noise(40.0, np.ones(3))
    return Walk.start(covariance, np.full(2, -1.0), np.full(2, 1.0), noise, speeds or {0.0: 1.0})


SLOPES = np.random.default_rng(0).standard_normal((4, 3, 2))
GRAM = np.einsum("nkp,nkq->pq", SLOPES, SLOPES)


def linear(change: Array) -> tuple[Array, Array]:
    return SLOPES @ change, SLOPES


def test_a_push_is_taken_in_as_by_bayes_where_the_mean_is_linear() -> None:
    residual, covariance = 0.02 * np.ones((4, 3)), np.tile(np.diag([1e-2, 2e-2, 3e-2]), (4, 1, 1))
    found, _ = walk().after(Observed(residual, covariance), linear)
    share = 1.0 / (1.0 + 3.0 * CORRELATION)
    precision = np.diag([25.0, 100.0]) + share * np.einsum("nkp,k,nkq->pq", SLOPES, [100.0, 50.0, 100.0 / 3.0], SLOPES)
    slope = share * np.einsum("nkp,k,nk->p", SLOPES, [100.0, 50.0, 100.0 / 3.0], residual)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(precision), rtol=1e-9)
    np.testing.assert_allclose(found.mean, np.linalg.solve(precision, slope), rtol=1e-9)


def test_between_pushes_the_covariance_grows_by_the_square_of_the_speed() -> None:
    blind = Observed(np.zeros((1, 3)), np.tile(1e9 * np.eye(3), (1, 1, 1)))
    found = walk({0.5: 1.0})
    for _ in range(4):
        found, _ = found.after(blind, lambda change: (np.zeros((1, 3)), np.zeros((1, 3, 2))))
    np.testing.assert_allclose(found.covariance, np.diag([0.04, 0.01]) * (1.0 + 4 * 0.25), rtol=1e-9)


def test_the_speed_is_learnt() -> None:
    speeds, rng = {0.0: 0.5, 0.5: 0.5}, np.random.default_rng(1)
    covariance = np.tile(1e-4 * np.eye(3), (4, 1, 1))
    for moving, likelier in ((0.0, 0), (0.1, 1)):
        found, value = walk(speeds), np.zeros(2)
        for _ in range(30):
            value = np.clip(value + moving * rng.standard_normal(2), -0.9, 0.9)
            residual = SLOPES @ value + 1e-2 * rng.standard_normal((4, 3))
            found, _ = found.after(Observed(residual, covariance), linear)
        assert np.argmax(found.probability) == likelier


def push_of(change: list[float], noise: float = 0.1) -> Observed:
    """What these changes do, exactly; its covariance says that it may be off by `noise`."""
    return Observed(SLOPES @ change, np.tile(noise**2 * np.eye(3), (4, 1, 1)))


def test_a_push_far_from_what_is_known_moves_the_parameters_less_than_by_bayes() -> None:
    found = walk()
    for _ in range(20):
        found, _ = found.after(push_of([0.0, 0.0]), linear)
    odd = push_of([0.0, 0.0])._replace(residual=np.tile([3.0, -3.0, 3.0], (4, 1)))
    after, _ = found.after(odd, linear)
    gain = np.linalg.inv(
        np.linalg.inv(found.covariance) + 100.0 / (1.0 + 3.0 * CORRELATION) * GRAM / found.noise.factor[0]
    )
    by_bayes = gain @ (100.0 / (1.0 + 3.0 * CORRELATION) * np.einsum("nkp,nk->p", SLOPES, odd.residual))
    assert np.linalg.norm(after.mean - found.mean) < 0.1 * np.linalg.norm(by_bayes)
    assert np.all(after.noise.factor < 1.2 * found.noise.factor)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_push_that_only_implausible_parameters_explain_is_refused_and_the_next_plausible_one_is_not(
    sign: float,
) -> None:
    start = walk({0.3: 1.0})
    found = start
    for _ in range(5):
        found, _ = found.after(push_of([sign * 3.0, 0.0], 0.01), linear)
    assert found.refused and abs(found.mean[0]) <= 1.0
    found, _ = start.after(push_of([sign * 0.2, 0.1], 0.01), linear)
    assert not found.refused and found.mean == pytest.approx([sign * 0.2, 0.1], abs=0.02)


# --- a recording ------------------------------------------------------------------------------------------------


def test_each_push_is_predicted_before_it_is_taken_in(deployed: PushModel, tmp_path: Path) -> None:
    change = constant("contact_friction", -0.15)
    table = concatenate([pushes(5, 1), pushes(20, 2, change)])
    found = follow(deployed, table, extended(deployed, change))
    first = each(table)[0]
    assert found.nlpd["deployed"][0] == pytest.approx(nlpd(deployed, first) + 1.5 * np.log(2.0 * np.pi), abs=1e-9)
    before = adapted_to(deployed, table.take(np.isin(table.push_id, table.pushes[:-1]))).adapted
    assert found.nlpd["adapted"][-1] == pytest.approx(nlpd(before, each(table)[-1]) + 1.5 * np.log(2.0 * np.pi))
    late = {name: values[15:].mean() for name, values in found.nlpd.items()}
    assert late["extended"] < late["adapted"] + 0.1 < late["deployed"]
    assert found.json["parameters"]["contact_friction"]["value"][-1] == found.parameters[-1][0].value
    assert "NLPD of pushes" in found.lines[0] and found.lines[-1].startswith("adapted: contact friction 0.1")
    assert found.draw(tmp_path / "followed.png").stat().st_size > 10_000
