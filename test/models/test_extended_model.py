# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A model extended by effects: predictions, needed covariates, files, and the estimation of effects."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drifting_models import DRIFT, GRAIN, NOISE, extended, grain, mechanics, pushes, slippery
from learnt_models import learnt
from made_up_traces import gain
from synthetic import square_rig, translating_push

from push_predictor.cli import main
from push_predictor.errors import RequestError
from push_predictor.models.effects.covariates import range_of
from push_predictor.models.effects.driver_basis import DriverBasis
from push_predictor.models.effects.effect import Effect
from push_predictor.models.effects.exact import joint, joint_shift
from push_predictor.models.prediction import Prediction
from push_predictor.models.predictors import PriorPredictor
from push_predictor.models.push_model import KINDS, PushModel
from push_predictor.models.pushes import Push
from push_predictor.models.request import PushRequest, check_pushes, check_request
from push_predictor.models.store.model_file import load_model, save_model
from push_predictor.models.tabulated.tabulated_model import MEAN_TOLERANCE, tabulate
from push_predictor.models.train import TrainingOptions, train_model
from push_predictor.recordings.streams import Recording
from push_predictor.recordings.table import PushTable
from push_predictor.recordings.table_file import write_table
from push_predictor.recordings.write import write_recording
from push_predictor.residuals.candidates.candidate import candidate
from push_predictor.residuals.evidence.standardised import evidence_of
from push_predictor.residuals.extension.extended_model import extend, refit_base

WARMTH = DriverBasis("linear", ("topic:/warmth",), (0.0,), (1.0,))
FIELDS = ("mean", "covariance", "process_covariance", "in_domain")


def with_effects(base: PushModel, table: PushTable, terms: list[Any], deployed: PushModel | None = None) -> PushModel:
    """The base with terms (mechanism, covariate, basis), estimated on the residuals of the deployed model."""
    evidence = evidence_of(deployed or base, table)
    return extend(base, evidence, [candidate(evidence, *term) for term in terms])


@pytest.fixture(scope="module")
def bases() -> dict[str, PushModel]:
    models = {
        kind: train_model(
            pushes(16 if kind == "prior" else 25),
            square_rig(),
            kind,
            name=f"a_{kind}",
            options=TrainingOptions(mean="zero"),
        )
        for kind in KINDS
    }
    prior = models["prior"].predictor
    assert isinstance(prior, PriorPredictor)
    return {**models, "prior": replace(models["prior"], predictor=replace(prior, draws=prior.draws[:8]))}


def predicted(model: Any, table: PushTable) -> Prediction:
    return model.predict_rows(table.inputs, table.duration, table.covariates)


def assert_same(one: Prediction, other: Prediction, **precision: float) -> None:
    for name in FIELDS:
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), **(precision or {"rtol": 0.0}))


# --- predictions -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_effect_of_size_zero_changes_nothing(bases: dict[str, PushModel], kind: str) -> None:
    base, table = bases[kind], pushes(20, 1)
    nothing = extended(base, slippery(0.0), grain(0.0).__class__(*GRAIN, np.zeros(2), np.zeros((2, 2)), np.ones(3)))
    assert_same(predicted(nothing, table), predicted(base, table))
    assert_same(predicted(tabulate(nothing), table), predicted(tabulate(base), table))
    exact, own = nothing.exact_log_density(table), base.exact_log_density(table)
    assert (exact is None) == (own is None) == (kind not in ("gp", "vhgp"))
    if exact is not None and own is not None:
        np.testing.assert_allclose(exact, own, rtol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_effects_shift_the_mean_and_add_their_uncertainty(bases: dict[str, PushModel], kind: str) -> None:
    base, table, effects = bases[kind], pushes(20, 1), (slippery(0.1, sd=0.05), grain(0.1))
    model, push = extended(base, *effects, scale=(0.5, 1.0, 2.0)), Push.of(table)
    ours, theirs = predicted(model, table), predicted(base, table)
    together = joint(model.predictor.mechanics, effects, push)
    pairs = zip(together.designs, effects, strict=True)
    uncertainty = [design @ effect.covariance @ design.transpose(0, 2, 1) for design, effect in pairs]
    scale = np.diag([0.5, 1.0, 2.0])
    np.testing.assert_allclose(ours.mean, theirs.mean + together.shift, rtol=1e-12)
    np.testing.assert_allclose(ours.covariance, scale @ theirs.covariance @ scale + sum(uncertainty), atol=1e-18)
    np.testing.assert_allclose(ours.process_covariance, scale @ theirs.process_covariance @ scale, atol=1e-18)


def test_effect_on_mechanics_with_a_grain_follows_the_heading_of_the_slider(bases: dict[str, PushModel]) -> None:
    """Also where it is all that differs from the pushes before."""
    base, table = bases["analytical"], pushes(20, 1)
    grained = replace(mechanics(), values={"grain_x": 0.4}, covariance=np.zeros((1, 1)))
    model = extended(replace(base, predictor=replace(base.predictor, fitted=grained)), slippery(0.2)).predictor
    turned = {**table.covariates, "slider_heading": table.covariates["slider_heading"] + 1.0}
    before, after = (model.shift(Push.of(replace(table, covariates=each))).mean for each in (table.covariates, turned))
    again = replace(model).shift(Push.of(replace(table, covariates=turned))).mean
    np.testing.assert_array_equal(after, again)
    assert not np.allclose(after, before, rtol=0.01, atol=0.0)


@pytest.fixture(params=["with tails", "without tails"])
def vhgp(bases: dict[str, PushModel], request: pytest.FixtureRequest) -> PushModel:
    """A VHGP whose exact predictive is a t distribution, or the VHGP's own."""
    base = bases["vhgp"]
    return base if request.param == "with tails" else replace(base, predictor=replace(learnt(base), tails=None))


def test_exact_density_is_that_of_the_base_shifted_by_the_effect(vhgp: PushModel) -> None:
    base, table, effect = vhgp, pushes(20, 1), slippery(0.2)
    shift = joint_shift(mechanics(), [effect], Push.of(table))
    moved = extended(base, effect).exact_log_density(replace(table, outcomes=table.outcomes + shift))
    np.testing.assert_allclose(moved, base.exact_log_density(table), rtol=1e-9)


def test_exact_density_has_the_predicted_variance(vhgp: PushModel) -> None:
    model, one = extended(vhgp, slippery(0.2, sd=0.3), scale=(0.5, 1.0, 2.0)), pushes(3, 1).take([0])
    prediction = predicted(model, one)
    sd = np.sqrt(np.diagonal(prediction.covariance[0]))
    steps = 100.0 * np.linspace(-1.0, 1.0, 8001) ** 3  # dense at the centre, wide for the tails
    rows = one.take(np.zeros(len(steps), dtype=int))
    density = np.exp(model.exact_log_density(replace(rows, outcomes=prediction.mean + steps[:, None] * sd)))
    weights = density * sd * np.gradient(steps)[:, None]
    np.testing.assert_allclose(weights.sum(axis=0), 1.0, rtol=1e-5)
    np.testing.assert_allclose((weights * steps[:, None] ** 2).sum(axis=0), 1.0, rtol=1e-2)


def joint_covariance(model: PushModel, table: PushTable) -> np.ndarray:
    """Covariance (n, 3, 3) of the effects' sum, from the covariance of all coefficients at once."""
    predictor = model.predictor
    sizes = [len(effect.coefficients) for effect in predictor.effects]
    ends = np.cumsum([0, *sizes])
    whole = np.zeros((ends[-1], ends[-1]))
    for k, effect in enumerate(predictor.effects):
        whole[ends[k] : ends[k + 1], ends[k] : ends[k + 1]] = effect.covariance
    for (i, j), shared in predictor.cross.items():
        whole[ends[i] : ends[i + 1], ends[j] : ends[j + 1]] = shared
        whole[ends[j] : ends[j + 1], ends[i] : ends[i + 1]] = shared.T
    push = Push.of(table)
    design = np.concatenate(joint(predictor.mechanics, predictor.effects, push).designs, axis=2)
    return design @ whole @ design.transpose(0, 2, 1)


@pytest.mark.slow
def test_added_effects_keep_shared_covariance_of_earlier_ones(bases: dict[str, PushModel], tmp_path: Path) -> None:
    table = pushes(25, 4, slippery(0.2))
    terms = [("contact_friction", "elapsed_time", DRIFT), GRAIN]
    first = with_effects(refit_base(bases["gp"], table), table, terms)
    second = with_effects(
        first, table, [(None, "topic:/warmth", WARMTH), ("inertia", "model_inputs", DriverBasis("constant"))]
    )
    assert list(first.predictor.cross) == [(0, 1)] and list(second.predictor.cross) == [(0, 1), (2, 3)]
    np.testing.assert_array_equal(first.predictor.cross[0, 1], second.predictor.cross[0, 1])
    assert refit_base(second, table).predictor.cross == second.predictor.cross
    save_model(second, tmp_path / "m")
    loaded, probe = load_model(tmp_path / "m"), pushes(10, 3)
    assert_same(predicted(loaded, probe), predicted(second, probe), rtol=1e-9, atol=1e-15)
    uncertainty = second.predictor.shift(Push(probe.inputs, probe.duration, probe.covariates))[1]
    np.testing.assert_allclose(uncertainty, joint_covariance(second, probe), rtol=1e-9, atol=1e-18)


# --- the range of its covariates -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "answer"), [("vhgp", lambda model: model), ("gp", tabulate), ("prior", lambda model: model)]
)
def test_covariate_outside_training_range_is_out_of_domain(bases: dict[str, PushModel], kind: str, answer) -> None:
    model, table = answer(extended(bases[kind], slippery(0.1), grain(0.1))), pushes(20, 1).take(np.arange(1, 59))
    inside = predicted(model, table).in_domain
    np.testing.assert_array_equal(inside, predicted(answer(bases[kind]), table).in_domain)
    assert inside.mean() > 0.8
    for time in (-50.0, 1100.0):
        late = replace(table, covariates={**table.covariates, "elapsed_time": np.full(58, time)})
        assert not predicted(model, late).in_domain.any()
        assert not predicted(model, late.take([0])).in_domain[0]
    one_late = table.covariates["elapsed_time"].copy()
    one_late[7] = 5000.0
    some = predicted(model, replace(table, covariates={**table.covariates, "elapsed_time": one_late})).in_domain
    np.testing.assert_array_equal(some, inside & (np.arange(58) != 7))
    warm = replace(table, covariates={**table.covariates, "topic:/warmth": np.full(58, 1e6)})  # not needed
    np.testing.assert_array_equal(predicted(model, warm).in_domain, inside)


@pytest.mark.parametrize(
    ("observed", "inside", "outside"),
    [
        ([-0.5, 0.0, 0.5], [-0.5, 0.2, 0.5, 0.5 + 2.0 * np.pi], [-0.6, 0.6, 3.0, -3.0]),
        ([3.0, -3.0], [3.0, np.pi, -np.pi, -3.0, 3.1], [2.9, -2.9, 0.0]),
        ([-2.0, 2.0, 3.1, -3.1], [2.0, 3.0, -2.5, -2.0], [0.0, 1.9, -1.9]),
        ([0.3], [0.3], [0.31, 0.29, 0.3 + np.pi]),
        (np.linspace(-np.pi, np.pi, 30), [-np.pi, 0.11, 3.0, 9.0], []),
    ],
)
def test_range_of_headings_wraps_around(observed: list[float], inside: list[float], outside: list[float]) -> None:
    known = range_of("slider_heading", np.array(observed))
    assert known.contains(np.array(inside)).all()
    assert not known.contains(np.array(outside)).any()


def test_covariates_that_follow_from_the_push_are_not_needed(bases: dict[str, PushModel]) -> None:
    faster = Effect(
        "inertia", "velocity", DriverBasis("linear", ("velocity",), (0.02,), (0.01,)), np.ones(1), np.eye(1), NOISE
    )
    sides = DriverBasis("category", ("edge",), levels=(0.0, 1.0, 2.0, 3.0))
    tip = Effect("contact_friction", "edge", sides, np.array([0.1, 0.2, 0.3]), 1e-4 * np.eye(3), NOISE)
    model, table = extended(bases["gp"], faster, tip), pushes(10, 1)
    assert model.needs == ()
    inputs = table.inputs * [2.0, 1.0, 1.0]
    given = {"velocity": inputs[:, 0], "edge": np.floor(4.0 * inputs[:, 1])}
    push = Push(inputs, table.duration, given)
    shift = joint_shift(mechanics(), [faster, tip], push)
    ours, theirs = (m.predict_rows(inputs, table.duration).mean for m in (model, bases["gp"]))
    np.testing.assert_allclose(ours - theirs, shift, atol=1e-15)
    alone = tabulate(model).predict_rows(inputs[:1], table.duration[:1])
    assert np.all(np.abs(alone.mean - ours[:1]) < MEAN_TOLERANCE * alone.std)


# --- needed covariates -------------------------------------------------------------------------------------------


def test_model_needs_covariates_of_bases_and_mechanisms(bases: dict[str, PushModel]) -> None:
    assert bases["gp"].needs == ()
    assert extended(bases["gp"], slippery(0.1), grain(0.1), slippery(0.2)).needs == ("elapsed_time", "slider_heading")


@pytest.mark.parametrize(
    ("brought", "message"),
    [
        ({}, "covariate elapsed_time: 'missing' is not accepted, give a finite number, in s"),
        ({"elapsed_time": np.nan}, "covariate elapsed_time: nan is not accepted, give a finite number, in s"),
        ({"elapsed_time": 1.0, "other": np.inf}, "covariate other: inf is not accepted, give a finite number"),
    ],
)
def test_rejects_request_without_needed_covariate_by_name(
    bases: dict[str, PushModel], brought: dict[str, float], message: str
) -> None:
    with pytest.raises(RequestError, match=message):
        check_request(extended(bases["gp"], slippery(0.1)), PushRequest(0.02, 0.1, 0.2, 0.2, brought))


def test_unneeded_covariates_are_ignored(bases: dict[str, PushModel]) -> None:
    push = PushRequest(0.02, 0.1, 0.2, 0.2, {"elapsed_time": 1.0, "other": 2.0})
    check_request(extended(bases["gp"], slippery(0.1)), push)
    table = pushes(5, 1)
    table.covariates["topic:/warmth"][:] = np.nan
    check_pushes(extended(bases["gp"], slippery(0.1)), table)


# --- estimation -------------------------------------------------------------------------------------------------


def test_refit_keeps_physics_and_estimates_covariance(bases: dict[str, PushModel]) -> None:
    base, table = bases["analytical"], pushes(60, 9)
    loud = replace(table, outcomes=table.outcomes + 5.0 * NOISE * np.random.default_rng(0).standard_normal((180, 3)))
    refit = refit_base(base, loud)
    probe = pushes(3, 1)
    np.testing.assert_array_equal(predicted(refit, probe).mean, predicted(base, probe).mean)
    assert np.all(np.diagonal(predicted(refit, probe).covariance[0] / predicted(base, probe).covariance[0]) > 9.0)


@pytest.mark.slow
def test_a_refit_of_an_extended_model_keeps_its_effects(bases: dict[str, PushModel]) -> None:
    table, held_out = pushes(40, 10, slippery(0.3)), pushes(30, 11, slippery(0.3))
    model = extended(bases["analytical"], slippery(0.3))
    refit = refit_base(model, table)
    assert refit.predictor.effects == model.predictor.effects
    plain = refit_base(bases["analytical"], table)
    assert gain(plain, refit, held_out)[1].high < 0.0
    more = with_effects(refit, table, [GRAIN])
    assert [effect.mechanism for effect in more.predictor.effects] == ["contact_friction", "anisotropic_friction"]
    assert np.all(np.abs(more.predictor.effects[1].coefficients) < 0.1)


# --- the command line -------------------------------------------------------------------


@pytest.fixture(scope="module")
def model_file(bases: dict[str, PushModel], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("extended") / "extended.model"
    save_model(replace(extended(bases["gp"], slippery(0.2, sd=0.1)), name="extended"), path)
    return path


def test_predict_command_accepts_and_requires_the_covariate(
    model_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    push = ["predict", str(model_file), "--velocity", "0.02", "--contact", "0.1", "--angle", "-0.8"]
    assert main(push) != 0
    assert "covariate elapsed_time: 'missing' is not accepted, give a finite number, in s" in capsys.readouterr().err
    means = []
    for time in ("0", "1000"):
        assert main([*push, "--covariate", f"elapsed_time={time}", "--json", "-"]) == 0
        means.append(json.loads(capsys.readouterr().out)["mean"])
    assert means[0] != means[1]
    assert main(["info", str(model_file), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["needs"] == ["elapsed_time"] and found["covariate_ranges"] == {"elapsed_time": [0.0, 1000.0]}


def turned_a_little(recording: Recording) -> Recording:
    """A slider with a constant heading would be refused: its quaternions are probably in another order."""
    heading = np.linspace(0.0, 1e-3, len(recording.slider))
    return replace(recording, slider=replace(recording.slider, heading=heading))


def test_evaluate_and_validate_name_the_missing_covariate(
    bases: dict[str, PushModel], model_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    warm = replace(slippery(0.2), basis=replace(DRIFT, drivers=("topic:/warmth",)))
    save_model(extended(bases["gp"], warm), tmp_path / "warm")
    write_table(tmp_path / "table.csv", replace(pushes(10, 1), covariates={}))
    write_recording(tmp_path / "bag", turned_a_little(translating_push()))
    assert main(["validate", str(model_file), str(tmp_path / "bag"), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["n_test"] == 5  # windows have the time
    for command, model, data in (("evaluate", model_file, "table.csv"), ("validate", tmp_path / "warm", "bag")):
        assert main([command, str(model), str(tmp_path / data)]) == 1
        name = "elapsed_time" if command == "evaluate" else "topic:/warmth"
        assert f"covariate {name}: 'missing' is not accepted" in capsys.readouterr().err
